import numpy as np
import pytest

from slam_uwb.matching import candidate_pairs, match_pairs
from slam_uwb.matching.index import index_scan
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MatchingSettings, ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.plan import Wall, build_plan
from slam_uwb.simulate.segments import cast_rays


def _ring(length, depth):
    corners = [(0.0, 0.0), (length, 0.0), (0.0, depth), (length, depth)]
    return [Wall(corners[a], corners[b], 0.2) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]


@pytest.fixture(scope="session")
def settings():
    return MatchingSettings()


@pytest.fixture(scope="session")
def view():
    """Station, walls, pose -> its indexed scan, one ray in the middle of each degree; exact without `rng`."""

    def cast(station, walls, pose, rng=None, noise=0.01, max_range=40.0):
        bearings = np.radians(np.arange(-180, 180) + 0.5)
        ranges = cast_rays(pose.translation, bearings + pose.theta, np.asarray(walls, dtype=float))
        if rng is not None:
            ranges = ranges + rng.normal(0.0, noise, len(ranges))
        scan = Scan(bearings, np.where(ranges <= max_range, ranges, np.nan), max_range)
        return index_scan(prepare_scan(station, scan, ScanSettings()), MatchingSettings())

    return cast


@pytest.fixture(scope="session")
def room():
    """An L-shaped room, 6 x 4.5 m: no other place in it looks the same."""
    corners = np.array([(0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)], dtype=float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


@pytest.fixture(scope="session")
def corridor():
    """Two walls 2 m apart, both ends out of sight."""
    return np.array([[(-100, 0), (100, 0)], [(-100, 2), (100, 2)]], dtype=float)


@pytest.fixture(scope="session")
def two_rooms():
    """Rooms of 4 and 5 x 4 m on either side of a wall 0.12 m thick at x = 4, with a door from y = 0.6 to 1.5."""
    walls = [*_ring(9.0, 4.0), Wall((4, 0), (4, 4), 0.12, ((1.05, 0.9),))]
    return build_plan(walls, []).faces


@pytest.fixture(scope="session")
def three_rooms():
    """Three rooms in a row, no two alike and none symmetrical, with doors between them."""
    walls = [
        Wall((0, 0), (11, 0)),
        Wall((0, 0), (0, 3)),
        Wall((0, 3), (3.5, 3)),
        Wall((3.5, 4.4), (11, 4.4)),
        Wall((11, 1.5), (11, 4.4)),
        Wall((9.5, 0), (9.5, 1.5)),
        Wall((9.5, 1.5), (11, 1.5)),
        Wall((3.5, 0), (3.5, 4.4), doors=((1.2, 0.9),)),
        Wall((8.3, 0), (8.3, 4.4), doors=((3.2, 0.9),)),
        # Screens inside the first and the second room.
        Wall((1.2, 2.2), (1.2, 3)),
        Wall((6, 0), (6, 0.9)),
    ]
    return build_plan(walls, []).faces


@pytest.fixture(scope="session")
def three_room_poses():
    """World poses of seven stations, two or three a room, some of them beside the doors."""
    places = [
        (1.0, 1.4, 0.3), (2.7, 1.3, 2.0), (4.3, 1.3, -1.1), (5.3, 2.9, 2.9), (7.4, 3.1, -2.4),
        (8.9, 3.1, 0.9), (10.1, 3.6, 1.7),
    ]  # fmt: skip
    return {f"s{k}": Pose2(*place) for k, place in enumerate(places, start=1)}


@pytest.fixture(scope="session")
def three_room_scans(view, three_rooms, three_room_poses):
    rng = np.random.default_rng(11)
    return {s: view(s, three_rooms, pose, rng, 0.005) for s, pose in three_room_poses.items()}


@pytest.fixture(scope="session")
def three_room_pairs(three_room_scans, settings):
    return candidate_pairs(tuple(three_room_scans), None, settings)


@pytest.fixture(scope="session")
def three_room_hypotheses(three_room_scans, three_room_pairs, settings):
    return match_pairs(three_room_pairs, three_room_scans, settings)


@pytest.fixture(scope="session")
def error():
    """(3,) absolute error of a pose: x, y m and heading rad in the source's axes."""

    def compare(found, truth):
        pose = found if isinstance(found, Pose2) else Pose2.from_vector(found)
        return np.abs((truth.inverse() @ pose).vector)

    return compare
