import numpy as np
import pytest

from slam_uwb.model.settings import ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.simulate.segments import cast_rays


@pytest.fixture(scope="session")
def settings():
    return ScanSettings()


@pytest.fixture(scope="session")
def polygon():
    """Corners -> (M, 2, 2) walls of a closed room."""

    def build(*corners):
        starts = np.array(corners, dtype=float)
        return np.stack([starts, np.roll(starts, -1, axis=0)], axis=1)

    return build


@pytest.fixture(scope="session")
def observe():
    """Walls and pose -> exact scan, one ray in the middle of each bin."""

    def cast(walls, pose, count=360, max_range=40.0):
        bearings = -np.pi + (np.arange(count) + 0.5) * 2.0 * np.pi / count
        ranges = cast_rays(pose.translation, bearings + pose.theta, np.asarray(walls, dtype=float))
        return Scan(bearings, np.where(ranges <= max_range, ranges, np.nan), max_range)

    return cast
