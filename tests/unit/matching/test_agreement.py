import math

import pytest

from slam_uwb.matching.agreement import placed, same_place
from slam_uwb.model.geometry import Pose2


def test_a_pair_has_a_pose_where_both_of_its_stations_have_a_place():
    """a looks along y, so what is 2 m to its left is 2 m back in x."""
    placement = {"a": Pose2(1.0, 0.0, math.pi / 2), "b": Pose2(-1.0, 0.0, math.pi / 2)}
    pose = placed("a", "b", placement)
    assert pose.vector == pytest.approx([0.0, 2.0, 0.0], abs=1e-12)
    assert placed("a", "c", placement) is None
    assert placed("c", "b", placement) is None


@pytest.mark.parametrize(
    ("b", "same"),
    [
        (Pose2(0.2, 0.0, 0.05), True),
        (Pose2(0.2, 0.2, 0.0), False),
        (Pose2(0.0, 0.0, 0.15), False),
        (None, False),
    ],
)
def test_places_are_the_same_within_both_limits(b, same):
    assert same_place(Pose2.identity(), b) is same


def test_headings_are_compared_across_the_seam():
    assert same_place(Pose2(0.0, 0.0, math.pi - 0.01), Pose2(0.0, 0.0, -math.pi + 0.01))
