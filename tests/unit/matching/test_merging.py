import math
from itertools import pairwise

import numpy as np
import pytest

from slam_uwb.matching.evidence import single_block
from slam_uwb.matching.gain import merge_blocks
from slam_uwb.matching.hypotheses import describe_match, match_pair
from slam_uwb.matching.merging import (
    aligned_gains,
    best_merge,
    merge_candidates,
    no_ranges,
    touching_stations,
)
from slam_uwb.model.geometry import Pose2

SQUARE = [((0, 0), (4, 0)), ((4, 0), (4, 4)), ((4, 4), (0, 4)), ((0, 4), (0, 0))]


@pytest.fixture
def merge(settings):
    """Scans, hypotheses -> the best way to merge the first two stations."""

    def best(scans, hypotheses, settings=settings, range_gain=no_ranges, **options):
        a, b = (single_block(station, scan) for station, scan in scans.items())
        touching = touching_stations(hypotheses)
        return best_merge(a, b, scans, touching, settings, range_gain, **options)

    return best


def hypothesis(scans, target, source, pose, settings, rank=0):
    return describe_match(scans[target], scans[source], pose.vector, rank, settings)


@pytest.mark.parametrize("places", [((2.2, 1.4), (1.1, 2.5)), ((2.0, 2.0), (2.0, 2.0))])
def test_hypotheses_that_contradict_each_other_leave_stations_apart(view, settings, merge, places):
    """In a square room four places are equally good, in its middle four headings: none by a margin."""
    rng = np.random.default_rng(1)
    scans = {
        "a": view("a", SQUARE, Pose2(*places[0], 0.3), rng),
        "b": view("b", SQUARE, Pose2(*places[1], 1.0), rng),
    }
    found = match_pair(scans["a"], scans["b"], settings)
    assert len(found) >= 4
    assert merge(scans, found) is None
    # With one of them alone nothing contradicts.
    alone = merge(scans, found[:1])
    assert Pose2.from_vector(alone.a_T_b).distance_to(found[0].target_T_source) < 0.02


def test_hypotheses_through_walls_leave_stations_apart(
    three_room_scans, three_room_poses, settings, merge
):
    """Whatever its score says: what the other scan looked through outweighs what it confirms."""
    wrong = three_room_poses["s3"].inverse() @ three_room_poses["s4"] @ Pose2(1.0, 0.7, 0.6)
    scans = {s: three_room_scans[s] for s in ("s3", "s4")}
    assert merge(scans, [hypothesis(scans, "s3", "s4", wrong, settings)]) is None


def test_places_along_a_row_of_niches_leave_stations_apart(view, settings, merge):
    """Niches every 3 m, the ends out of sight: three metres on, with the same heading, all looks the same."""
    corners = [
        (x + dx, y) for x in range(-60, 60, 3) for dx, y in ((0, 0), (2, 0), (2, -0.6), (3, -0.6))
    ]
    front = np.array([*pairwise(corners)], dtype=float)
    walls = np.concatenate([front, [[(-60, 2), (60, 2)]]])
    a, b = Pose2(0.6, 0.9, 0.3), Pose2(1.9, 1.1, 1.0)
    scans = {s: view(s, walls, p, max_range=8.0) for s, p in (("a", a), ("b", b))}
    places = [a.inverse() @ Pose2(b.x + shift, b.y, b.theta) for shift in (0.0, 3.0, -3.0)]
    found = [hypothesis(scans, "a", "b", p, settings, k) for k, p in enumerate(places)]
    margins = settings.model_copy(update={"min_margin_m": 12.0})
    assert merge(scans, found[:1], margins) is not None
    assert merge(scans, found, margins) is None


def test_ranges_decide_where_walls_leave_several_places(view, settings, merge):
    """Of four places that walls hold alike, the one that the ranges prefer by far."""
    a, b = Pose2(2.2, 1.4, 0.3), Pose2(1.1, 2.5, 1.0)
    scans = {"a": view("a", SQUARE, a), "b": view("b", SQUARE, b)}
    found = match_pair(scans["a"], scans["b"], settings)
    truth = a.inverse() @ b

    def near_the_truth(a_poses, b_poses, candidates):
        assert (list(a_poses), list(b_poses)) == (["a"], ["b"])
        return np.where(np.hypot(*(candidates[:, :2] - truth.vector[:2]).T) < 0.3, 5.0, 0.0)

    best = merge(scans, found, range_gain=near_the_truth)
    assert Pose2.from_vector(best.a_T_b).distance_to(truth) < 0.02


def test_beyond_enough_wall_only_ranges_raise_the_priority(view, settings, merge):
    """The square's 16 m twice over confirm the fit; 8 m of them count, and 5 nats at 3 m each."""
    a, b = Pose2(2.2, 1.4, 0.3), Pose2(1.1, 2.5, 1.0)
    scans = {"a": view("a", SQUARE, a), "b": view("b", SQUARE, b)}
    right = [hypothesis(scans, "a", "b", a.inverse() @ b, settings)]
    walls = merge(scans, right)
    ranges = merge(scans, right, range_gain=lambda _a, _b, candidates: 5.0 + candidates[:, 0] * 0.0)
    assert walls.margin > 25.0
    assert walls.priority == 8.0
    assert ranges.margin == pytest.approx(walls.margin + 15.0)
    assert ranges.priority == pytest.approx(8.0 + 15.0)


def test_leaving_apart_at_a_loss_is_a_lesser_rival(view, settings, merge):
    """No wall in common: nothing is gained, which is more than what leaving them apart would lose."""
    east = [((4, -1), (4, 1))]
    west = [((-4, -1), (-4, 1))]
    scans = {s: view(s, walls, Pose2.identity()) for s, walls in (("a", east), ("b", west))}
    facing = [hypothesis(scans, "a", "b", Pose2.identity(), settings)]
    assert merge(scans, facing) is None
    drift = merge(scans, facing, apart=-10.0 - settings.min_margin_m)
    assert drift.margin == pytest.approx(10.0 + settings.min_margin_m)


def test_candidates_are_distinct_and_those_with_most_support_first(three_room_scans, settings):
    """Two weak hypotheses of one place, through different stations, against a stronger one alone."""
    scans = three_room_scans
    a = merge_blocks(
        single_block("s1", scans["s1"]),
        single_block("s2", scans["s2"]),
        np.array([1.0, 0.0, 0.0]),
        scans,
        settings,
    )
    b = single_block("s3", scans["s3"])

    def scored(target, x, score):
        pose = Pose2(x, 0.0, 0.0)
        found = hypothesis(scans, target, "s3", pose, settings)
        return type(found)(target, "s3", pose, found.covariance, 0.5, 0.0, score, 0)

    # s2 stands at x = 1 in the block: 2 m ahead of it is 3 m ahead of s1.
    found = [scored("s1", 5.0, 5.0), scored("s1", 3.0, 3.0), scored("s2", 2.1, 3.0)]
    places = merge_candidates(a, b, touching_stations(found))
    np.testing.assert_allclose(places, [[3.0, 0.0, 0.0], [5.0, 0.0, 0.0]], atol=1e-12)
    # The same where the smaller block comes first, seen from the other side.
    back = merge_candidates(b, a, touching_stations(found))
    np.testing.assert_allclose(back, [[-3.0, 0.0, 0.0], [-5.0, 0.0, 0.0]], atol=1e-12)


def test_the_walls_of_two_blocks_settle_on_each_other(three_room_scans, three_room_poses, settings):
    """Exact within the blocks, 10 cm and 2 degrees off between them: what joins them is aligned."""
    scans, truth = three_room_scans, three_room_poses

    def block(m, n):
        place = (truth[m].inverse() @ truth[n]).vector
        ends = (single_block(station, scans[station]) for station in (m, n))
        return merge_blocks(*ends, place, scans, settings)

    blocks = block("s3", "s4"), block("s5", "s6")
    right = truth["s3"].inverse() @ truth["s5"]
    for error in (Pose2(0.1, 0.0, 0.035), Pose2(-0.06, 0.08, -0.035)):
        candidates = (right @ error).vector[None, :]
        settled, _ = aligned_gains(*blocks, candidates, scans, settings)
        left = right.inverse() @ Pose2.from_vector(settled[0])
        assert left.distance_to(Pose2.identity()) < 0.03
        assert abs(left.theta) < math.radians(0.4)
