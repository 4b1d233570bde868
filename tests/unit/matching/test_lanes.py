import numpy as np
import pytest

from slam_uwb.matching.batch import compose, invert
from slam_uwb.matching.correspondences import correspondences
from slam_uwb.matching.lanes import both_ways, lanes, lanes_both_ways
from slam_uwb.matching.pairing import pair_points
from slam_uwb.matching.score import point_evidence
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)


@pytest.fixture(params=[6.0, 2.2], ids=["as many points", "fewer points"])
def scans(request, view, room):
    """Two scans of a room, the second with a reach that may miss some of it, and two poses near the true one."""
    target, source = view("a", room, A), view("b", room, B, max_range=request.param)
    assert (len(source.lengths) < len(target.lengths)) == (request.param < 6.0)
    off = np.array([[0.03, -0.02, 0.01], [-0.1, 0.05, -0.03]])
    return target, source, compose(np.tile((A.inverse() @ B).vector, (2, 1)), off)


def each_way(scans):
    """Target, source and poses of both ways."""
    target, source, poses = scans
    return (target, source, poses), (source, target, invert(poses))


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("stride", [1, 3])
def test_a_pair_is_paired_as_one_scan_after_the_other(scans, exact, stride):
    pair = lanes_both_ways([scans[:2]])
    found = pair_points(pair, pair, both_ways(scans[2][None]), stride=stride, exact=exact)
    for way, (target, source, poses) in enumerate(each_way(scans)):
        alone = pair_points(target, source, poses, stride=stride, exact=exact)
        count = alone.x.shape[1]
        for name in ("x", "y", "across", "squared", "normal_x", "normal_y", "facing"):
            np.testing.assert_array_equal(
                getattr(found, name)[way, :, :count], getattr(alone, name)
            )
        first = way * pair.lengths.shape[-1]
        np.testing.assert_array_equal(found.partner[way, :, :count], alone.partner + first)


def test_points_that_fill_up_the_shorter_scan_weigh_nothing(scans, settings):
    pair = lanes_both_ways([scans[:2]])
    poses = both_ways(scans[2][None])
    rows = correspondences(pair, pair, poses, gate=0.2)
    said = point_evidence(pair, pair, poses, settings)
    for way, (target, source, one_way) in enumerate(each_way(scans)):
        alone = correspondences(target, source, one_way, gate=0.2)
        count = alone.weight.shape[1]
        np.testing.assert_array_equal(rows.weight[way, :, :count], alone.weight)
        np.testing.assert_array_equal(rows.jacobian[way, :, :count], alone.jacobian)
        assert not rows.weight[way, :, count:].any()
        assert not said.seen_through[way, :, count:].any()
        assert not pair.lengths[way, :, count:].any()


def test_some_of_the_lanes_are_those_lanes(scans, settings):
    target, source, poses = scans
    all_three = lanes([(target, source), (source, target), (source, source)])
    kept = np.array([True, False, True])
    places = np.stack([poses, invert(poses), poses])
    some = all_three.of(kept)
    whole = point_evidence(all_three, all_three, places, settings)
    part = point_evidence(some, some, places[kept], settings)
    assert whole.hit[kept].any()
    np.testing.assert_array_equal(part.hit, whole.hit[kept])
    np.testing.assert_array_equal(part.seen_through, whole.seen_through[kept])
