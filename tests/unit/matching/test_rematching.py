import numpy as np
import pytest

from slam_uwb.matching.hypotheses import describe_match
from slam_uwb.matching.rematching import leave_free_directions, rematch_pairs
from slam_uwb.model.geometry import Pose2

SIDE_BY_SIDE = [("s1", "s2"), ("s2", "s3"), ("s3", "s4"), ("s4", "s5"), ("s5", "s6"), ("s6", "s7")]


def truth_of(poses, pair):
    return poses[pair[0]].inverse() @ poses[pair[1]]


def test_pairs_of_a_placement_are_matched_where_it_has_them(
    three_room_scans, three_room_pairs, three_room_poses, settings
):
    world = Pose2(5.0, -3.0, 2.0)
    nudge = Pose2(0.03, -0.02, 0.01)
    placement = {s: world @ p @ (nudge if s == "s4" else Pose2.identity())
                 for s, p in three_room_poses.items()}  # fmt: skip
    matches = rematch_pairs(three_room_scans, placement, three_room_pairs, settings)
    pairs = [(m.target, m.source) for m in matches]
    assert len(set(pairs)) == len(pairs)
    assert set(SIDE_BY_SIDE) <= set(pairs) <= set(three_room_pairs)
    for match in matches:
        truth = truth_of(three_room_poses, (match.target, match.source))
        if match.overlap > 0.3:
            assert match.target_T_source.distance_to(truth) < 0.01
        assert match.rank == 0
        assert match.score >= settings.min_evidence_m


def test_stations_without_a_place_are_not_rematched(
    three_room_scans, three_room_pairs, three_room_poses, settings
):
    placement = {s: three_room_poses[s] for s in ("s1", "s2", "s5")}
    matches = rematch_pairs(three_room_scans, placement, three_room_pairs, settings)
    assert {s for m in matches for s in (m.target, m.source)} <= set(placement)


def test_a_wrong_placement_gives_no_match(three_room_scans, three_room_poses, settings):
    placement = {"s3": three_room_poses["s3"], "s4": three_room_poses["s4"] @ Pose2(0.9, 0.8, 0.5)}
    assert rematch_pairs(three_room_scans, placement, [("s3", "s4")], settings) == ()


def test_a_match_that_leaves_its_placement_is_none_of_its(view, room, settings):
    """14.6 cm off along x and y every wall is still within reach: the scans come together, 20.6 cm away."""
    a, b = Pose2(2.0, 1.5, 0.0), Pose2(3.0, 2.0, 0.0)
    scans = {"a": view("a", room, a), "b": view("b", room, b)}
    for off, found in ((0.05, 1), (0.146, 0)):
        placement = {"a": a, "b": Pose2(b.x + off, b.y + off, 0.0)}
        assert len(rematch_pairs(scans, placement, [("a", "b")], settings)) == found


def test_weak_pairs_are_used_only_where_they_join(
    three_room_scans, three_room_pairs, three_room_poses, settings
):
    everything = rematch_pairs(
        three_room_scans, three_room_poses, three_room_pairs,
        settings.model_copy(update={"min_overlap": 0.0}),
    )  # fmt: skip
    overlaps = sorted(match.overlap for match in everything)
    for limit in (overlaps[len(overlaps) // 2] + 1e-9, 1.0):
        kept = rematch_pairs(
            three_room_scans, three_room_poses, three_room_pairs,
            settings.model_copy(update={"min_overlap": limit}),
        )  # fmt: skip
        weak = [m for m in kept if m.overlap < limit]
        strong = [m for m in kept if m.overlap >= limit]
        assert len(strong) == sum(value >= limit for value in overlaps)
        # Seven stations in one piece: as many weak ones as pieces have to be joined.
        pieces = {s: {s} for s in three_room_poses}
        for match in strong + sorted(weak, key=lambda m: -m.overlap):
            a, b = pieces[match.target], pieces[match.source]
            assert match in strong or a is not b
            a |= b
            pieces.update(dict.fromkeys(b, a))
        assert len({id(piece) for piece in pieces.values()}) == 1


def test_the_used_matches_of_a_placement_do_not_depend_on_its_frame(
    three_room_scans, three_room_pairs, three_room_poses, settings
):
    world = Pose2(-7.0, 2.0, 3.0)
    here = rematch_pairs(three_room_scans, three_room_poses, three_room_pairs, settings)
    moved = {s: world @ pose for s, pose in three_room_poses.items()}
    there = rematch_pairs(three_room_scans, moved, three_room_pairs, settings)
    assert [(m.target, m.source) for m in here] == [(m.target, m.source) for m in there]
    for a, b in zip(here, there, strict=True):
        assert a.target_T_source.distance_to(b.target_T_source) < 1e-3


def test_what_walls_leave_free_stays_where_the_placement_has_it(view, corridor, settings):
    """Two scans of a corridor slid along it: across, the match decides; along, the placement."""
    rng = np.random.default_rng(5)
    target = view("a", corridor, Pose2.identity(), rng, 0.01)
    source = view("b", corridor, Pose2(1.0, 0.3, 0.0), rng, 0.01)
    match = describe_match(target, source, np.array([1.4, 0.3, 0.0]), 0, settings)
    assert match.degenerate
    left = leave_free_directions(match, Pose2(0.9, 0.36, 0.02)).target_T_source
    # The heading of the start is 0.02: its long axis is the corridor's but for 0.02 x 0.5 m.
    assert left.x == pytest.approx(0.9, abs=0.02)
    assert left.y == pytest.approx(0.3, abs=0.02)
    assert left.theta == pytest.approx(0.0, abs=1e-3)


def test_a_match_that_walls_hold_is_left_as_it_is(three_room_scans, three_room_poses, settings):
    pose = three_room_poses["s1"].inverse() @ three_room_poses["s2"]
    match = describe_match(three_room_scans["s1"], three_room_scans["s2"], pose.vector, 0, settings)
    left = leave_free_directions(match, pose @ Pose2(0.1, -0.1, 0.05)).target_T_source
    assert left.distance_to(pose) < 1e-9
    assert left.angle_to(pose) < 1e-9
