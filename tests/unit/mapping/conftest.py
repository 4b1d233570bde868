import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays


@pytest.fixture(scope="session")
def outline():
    """Corners of one closed outline -> (M, 2, 2) faces."""

    def build(*corners):
        starts = np.array(corners, dtype=float)
        return np.stack([starts, np.roll(starts, -1, axis=0)], axis=1)

    return build


@pytest.fixture(scope="session")
def look():
    """Faces and pose -> prepared exact scan, four rays a degree."""

    def cast(faces, pose):
        bearings = -np.pi + (np.arange(1440) + 0.5) * 2.0 * np.pi / 1440
        ranges = cast_rays(pose.translation, bearings + pose.theta, np.asarray(faces, dtype=float))
        scan = Scan(bearings, np.where(np.isfinite(ranges), ranges, np.nan), 40.0)
        return prepare_scan("s", scan, ScanSettings())

    return cast


@pytest.fixture(scope="session")
def visit(look):
    """Faces and places (x, y) -> scans and poses, each station with a heading of its own."""

    def record(faces, *places):
        poses = {f"s{k}": Pose2(x, y, 0.7 * k - 2.0) for k, (x, y) in enumerate(places)}
        return {name: look(faces, pose) for name, pose in poses.items()}, poses

    return record


@pytest.fixture(scope="session")
def prepare_survey():
    """A simulated survey -> prepared scans and its true poses, with noise where wanted."""

    def prepare(simulation, sigma=0.0, sigma_theta=0.0, rng=None):
        rng = rng or np.random.default_rng(0)
        scans = {
            s.id: prepare_scan(s.id, s.scan, ScanSettings()) for s in simulation.survey.stations
        }
        scales = np.array([sigma, sigma, sigma_theta])
        poses = {
            name: Pose2(*(np.array([p.x, p.y, p.theta]) + scales * rng.normal(size=3)))
            for name, p in simulation.reference.stations.items()
        }
        return scans, poses

    return prepare
