import numpy as np
import pytest

from slam_uwb.matching.spanning import in_first_frame, largest_group, spanning_placement
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import ScanMatch


def match(target, source, pose=Pose2(1.0, 0.0, 0.0), score=10.0):
    return ScanMatch(target, source, pose, np.eye(3) * 1e-4, 0.5, 0.0, score, 0)


def test_the_tree_follows_the_best_matches():
    weak = match("a", "c", Pose2(9.0, 9.0, 0.0), score=1.0)
    strong = [match("a", "b", score=5.0), match("b", "c", score=4.0)]
    placement = spanning_placement("abc", [weak, *strong])
    assert placement["c"] == Pose2(2.0, 0.0, 0.0)


def test_a_match_can_be_walked_backwards():
    turn = Pose2(1.0, 2.0, 0.5)
    placement = spanning_placement("ab", [match("b", "a", turn)])
    assert placement["a"] == Pose2.identity()
    np.testing.assert_allclose(placement["b"].vector, turn.inverse().vector, atol=1e-12)


def test_the_frame_is_that_of_the_first_station_in_the_order_given():
    matches = [match("c", "b", Pose2(1.0, 0.0, 1.0)), match("d", "c", Pose2(0.0, 2.0, 2.0))]
    placement = spanning_placement("abcd", matches)
    assert list(placement) == ["b", "c", "d"]
    assert placement["b"] == Pose2.identity()
    np.testing.assert_allclose(
        (placement["d"].inverse() @ placement["c"]).vector, [0.0, 2.0, 2.0], atol=1e-12
    )


def test_of_groups_of_one_size_the_first_in_order_counts():
    assert list(spanning_placement("abcd", [match("c", "d"), match("a", "b")])) == ["a", "b"]


def test_groups_merge_whichever_match_joins_them():
    matches = [match("a", "b", score=9.0), match("c", "d", score=8.0), match("d", "b", score=1.0)]
    placement = spanning_placement("abcd", matches)
    # b is 1 m ahead of a and of d, d is 1 m ahead of c.
    expected = {"a": 0.0, "b": 1.0, "c": -1.0, "d": 0.0}
    assert {s: pose.x for s, pose in placement.items()} == pytest.approx(expected)


def test_a_group_keeps_its_places_and_not_those_of_its_matches():
    """c is connected to nobody; b stands 2 m from a although its match says 1 m."""
    placement = {"c": Pose2(9.0, 9.0, 0.0), "a": Pose2(1.0, 0.0, 0.0), "b": Pose2(3.0, 0.0, 0.0)}
    group = largest_group(placement, [match("a", "b")])
    assert group == {"a": Pose2.identity(), "b": Pose2(2.0, 0.0, 0.0)}


def test_nobody_has_no_frame():
    assert in_first_frame({}) == largest_group({}, ()) == {}
