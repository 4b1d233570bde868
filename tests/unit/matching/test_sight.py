import numpy as np
import pytest

from slam_uwb.matching.batch import invert
from slam_uwb.matching.correspondences import correspondences
from slam_uwb.matching.score import point_evidence
from slam_uwb.matching.sight import Sights, may_meet
from slam_uwb.model.geometry import Pose2


def meet(one, other, poses):
    return may_meet(Sights.of([one.sight]), other.sight, poses[None])[0]


def said(target, source, poses, settings):
    """(K,) whether the target says anything of the source's points, or the refiner finds any a partner."""
    evidence = point_evidence(target, source, poses, settings)
    rows = correspondences(target, source, poses, gate=0.5)
    return (evidence.hit + evidence.seen_through + rows.weight).any(axis=1)


@pytest.fixture
def hall():
    """Larger than the raster: its far wall is 38 m away."""
    corners = np.array([(-2, -3), (38, -3), (38, 3), (-2, 3)], dtype=float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def random_poses(count, reach):
    rng = np.random.default_rng(3)
    poses = rng.uniform(-1.0, 1.0, (count, 3)) * [reach, reach, np.pi]
    return np.asarray(poses)


@pytest.mark.parametrize("reach", [3.0, 15.0, 60.0])
def test_what_may_not_meet_says_nothing(three_room_scans, view, hall, settings, reach):
    scans = [*three_room_scans.values()][:3]
    scans.append(view("h", hall, Pose2(0.0, 0.0, 0.7)))
    poses = random_poses(300, reach)
    for one in scans:
        for other in scans:
            silent = ~meet(one, other, poses)
            assert not said(one, other, poses[silent], settings).any()
            assert not said(other, one, invert(poses[silent]), settings).any()


def test_closed_rooms_side_by_side_do_not_meet(view, room, settings):
    """Walls 4 m apart: by how far their scans see, stations 11 m from each other might."""
    scan = view("a", room, Pose2(3.0, 1.5, 0.0))
    beside = np.array([[10.5, 0.0, 0.0], [0.0, 11.0, 1.5], [-11.0, 3.0, 0.1]])
    assert not meet(scan, scan, beside).any()
    assert meet(scan, scan, np.zeros((1, 3))).all()


def test_meeting_is_mutual(three_room_scans):
    one, other = [*three_room_scans.values()][:2]
    poses = random_poses(200, 12.0)
    met = meet(one, other, poses)
    np.testing.assert_array_equal(met, meet(other, one, invert(poses)))
    assert 0 < met.sum() < len(poses)


def test_many_scans_are_judged_as_one_by_one(three_room_scans, view, hall):
    scans = [*three_room_scans.values(), view("h", hall, Pose2.identity())]
    other, poses = scans[0], random_poses(5 * len(scans), 20.0).reshape(len(scans), 5, 3)
    together = may_meet(Sights.of([scan.sight for scan in scans]), other.sight, poses)
    alone = [meet(scan, other, own) for scan, own in zip(scans, poses, strict=True)]
    np.testing.assert_array_equal(together, alone)


def test_sights_one_after_the_other_are_those_of_all(view, room, corridor):
    """Scans with places of different numbers, put together step by step."""
    scans = [view("a", room, Pose2(2.0, 1.5, 0.4)), view("b", corridor, Pose2(0.0, 0.8, 0.1)),
             view("c", room, Pose2(1.0, 1.0, -2.0), max_range=1.5)]  # fmt: skip
    sights = [scan.sight for scan in scans]
    assert len({len(sight.places) for sight in sights}) == 3
    together = Sights.of(sights)
    joined = Sights.of(sights[:1]) + (Sights.of(sights[1:2]) + Sights.of(sights[2:]))
    poses = np.random.default_rng(4).uniform([-30, -30, -3], [30, 30, 3], (3, 300, 3))
    for sight in sights:
        met = may_meet(together, sight, poses)
        assert met.any()
        assert not met.all()
        np.testing.assert_array_equal(may_meet(joined, sight, poses), met)
