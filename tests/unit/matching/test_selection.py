import math
from collections import Counter

import numpy as np
import pytest

from slam_uwb.matching import select_matches
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import ScanMatch


def leave(placement, matches):
    """The pose graph of these tests: everything stays where it is."""
    return dict(placement)


def match(target, source, pose=Pose2(1.0, 0.0, 0.0), score=10.0, rank=0):
    return ScanMatch(target, source, pose, np.eye(3) * 1e-4, 0.5, 0.0, score, rank)


@pytest.fixture(scope="module")
def selected(three_room_scans, three_room_hypotheses, three_room_pairs, settings):
    return select_matches(
        three_room_scans, three_room_hypotheses, three_room_pairs, settings, adjust=leave
    )


@pytest.fixture(scope="module")
def by_sequence(settings):
    return settings.model_copy(update={"placement": "sequence"})


def test_stations_are_placed_as_they_truly_lie(selected, three_room_poses):
    assert selected.placement.keys() == three_room_poses.keys()
    first = next(iter(selected.placement))
    assert selected.placement[first] == Pose2.identity()
    for station, pose in selected.placement.items():
        truth = three_room_poses[first].inverse() @ three_room_poses[station]
        assert pose.distance_to(truth) < 0.03
        assert pose.angle_to(truth) < math.radians(0.5)


def test_used_matches_are_right_and_at_most_one_a_pair(selected, three_room_poses, settings):
    pairs = Counter((m.target, m.source) for m in selected.used)
    assert max(pairs.values()) == 1
    assert not any((n, m) in pairs for m, n in pairs)
    for used in selected.used:
        truth = three_room_poses[used.target].inverse() @ three_room_poses[used.source]
        assert used.rejection is None
        if used.overlap > 0.3:
            assert used.target_T_source.distance_to(truth) < 0.01
        assert used.target_T_source.distance_to(truth) < 2 * settings.fine_gate_m


def test_every_hypothesis_has_its_row_and_a_reason_or_is_used(selected, three_room_hypotheses):
    used = {(m.target, m.source): m for m in selected.used}
    rows = {}
    for row in selected.matches:
        rows.setdefault((row.target, row.source), []).append(row)
    counts = Counter((m.target, m.source) for m in three_room_hypotheses)
    for pair, found in rows.items():
        # The used match takes the place of the hypothesis that it came from, or one place more.
        assert len(found) - counts[pair] in ((0, 1) if pair in used else (0,))
        assert [row.rank for row in found] == list(range(len(found)))
        accepted = [row for row in found if row.rejection is None]
        assert len(accepted) == (pair in used)
        if accepted:
            assert accepted[0].target_T_source == used[pair].target_T_source
            assert accepted[0].score == used[pair].score
    assert rows.keys() == counts.keys() | used.keys()


def test_reasons_say_what_is_the_matter(selected):
    used = {(m.target, m.source) for m in selected.used}
    for row in selected.matches:
        if row.rejection is not None and (row.target, row.source) in used:
            assert row.rejection == "another hypothesis of the pair is used"
        if row.rejection is not None and (row.target, row.source) not in used:
            assert row.rejection in (
                "disagrees with the merged map",
                "too little overlap",
                "fits beside where the other matches have it",
            )


def test_hypotheses_of_stations_that_are_not_placed_say_so(
    view, room, three_room_scans, three_room_hypotheses, three_room_pairs, settings
):
    scans = {**three_room_scans, "zz": view("zz", room, Pose2(2.0, 1.5, 0.0))}
    lonely = match("s1", "zz", Pose2(30.0, 0.0, 0.0))
    result = select_matches(
        scans,
        [*three_room_hypotheses, lonely],
        [*three_room_pairs, ("s1", "zz")],
        settings,
        adjust=leave,
    )
    assert "zz" not in result.placement
    row = result.matches[-1]
    assert (row.target, row.source, row.rejection) == ("s1", "zz", "zz is not placed")


def test_a_hypothesis_turned_about_its_place_disagrees_with_the_map(
    three_room_scans, three_room_hypotheses, three_room_pairs, three_room_poses, settings
):
    """The right place with a wrong heading is no match with little overlap."""
    others = [m for m in three_room_hypotheses if {m.target, m.source} != {"s1", "s7"}]
    truth = three_room_poses["s1"].inverse() @ three_room_poses["s7"]
    turned = match("s1", "s7", truth @ Pose2(0.0, 0.0, math.pi))
    right = match("s1", "s7", truth, rank=1)
    strict = settings.model_copy(update={"min_overlap": 0.9, "min_evidence_m": 1.0})
    pairs = [pair for pair in three_room_pairs if pair != ("s1", "s7")]
    result = select_matches(three_room_scans, [*others, turned, right], pairs, strict, adjust=leave)
    assert len(result.placement) == 7
    rows = [row.rejection for row in result.matches if (row.target, row.source) == ("s1", "s7")]
    assert rows == ["disagrees with the merged map", "too little overlap"]


def test_the_used_match_takes_the_rank_of_the_hypothesis_it_came_from(
    three_room_scans, three_room_hypotheses, three_room_pairs, three_room_poses, settings
):
    """A pair whose best hypothesis is wrong and whose second is right: the second is used."""
    others = [m for m in three_room_hypotheses if (m.target, m.source) != ("s3", "s4")]
    truth = three_room_poses["s3"].inverse() @ three_room_poses["s4"]
    pair = [match("s3", "s4", truth @ Pose2(2.0, 1.0, 1.5)), match("s3", "s4", truth, rank=1)]
    result = select_matches(
        three_room_scans, [*others, *pair], three_room_pairs, settings, adjust=leave
    )
    rows = [row for row in result.matches if (row.target, row.source) == ("s3", "s4")]
    assert [row.rank for row in rows] == [0, 1]
    assert [row.rejection for row in rows] == ["another hypothesis of the pair is used", None]


def test_the_pose_graph_moves_the_placement(
    three_room_scans, three_room_hypotheses, three_room_pairs, settings
):
    """What `adjust` returns is where pairs are matched again; it is given what holds them."""
    calls = []

    def shift(placement, matches):
        calls.append((dict(placement), tuple(matches)))
        return {s: Pose2(100.0, 0.0, 0.0) @ pose for s, pose in placement.items()}

    result = select_matches(
        three_room_scans, three_room_hypotheses, three_room_pairs, settings, adjust=shift
    )
    assert len(calls) >= 1
    for placement, matches in calls:
        assert len(placement) == 7
        assert len(matches) >= 6
    # The frame is the first station's, wherever the pose graph put it.
    assert result.placement[next(iter(result.placement))] == Pose2.identity()


def test_stations_that_no_used_match_connects_any_more_leave_the_group(
    three_room_scans, three_room_hypotheses, three_room_pairs, settings
):
    def lose(placement, matches):
        return {s: pose @ Pose2(50.0, 0.0, 0.0) if s == "s1" else pose
                for s, pose in placement.items()}  # fmt: skip

    result = select_matches(
        three_room_scans, three_room_hypotheses, three_room_pairs, settings, adjust=lose
    )
    assert set(result.placement) == {f"s{k}" for k in range(2, 8)}
    assert all("s1" not in (m.target, m.source) for m in result.used)
    for row in result.matches:
        if "s1" in (row.target, row.source):
            assert row.rejection == "s1 is not placed"


def test_sequence_uses_the_best_match_of_every_pair(
    three_room_scans, three_room_hypotheses, three_room_pairs, by_sequence
):
    result = select_matches(
        three_room_scans, three_room_hypotheses, three_room_pairs, by_sequence, adjust=leave
    )
    assert all(used.rank == 0 for used in result.used)
    assert [(u.target, u.source) for u in result.used] == [
        pair for pair in three_room_pairs
        if any((h.target, h.source) == pair for h in three_room_hypotheses)
    ]  # fmt: skip
    assert len(result.matches) == len(three_room_hypotheses)
    for row in result.matches:
        expected = None if row.rank == 0 else "another hypothesis of the pair is used"
        assert row.rejection == expected


def test_a_chain_is_placed_by_equations_6_to_8(by_sequence, three_room_scans):
    """Each step 1 m ahead and a quarter turn: the corners of a square."""
    step = Pose2(1.0, 0.0, math.pi / 2)
    chain = [match("s1", "s2", step), match("s2", "s3", step), match("s3", "s4", step)]
    result = select_matches(three_room_scans, chain, (), by_sequence, adjust=leave)
    places = {s: pose.vector for s, pose in result.placement.items()}
    expected = {"s1": (0, 0, 0), "s2": (1, 0, 0.5), "s3": (1, 1, 1), "s4": (0, 1, -0.5)}
    assert places.keys() == expected.keys()
    for station, (x, y, half_turns) in expected.items():
        np.testing.assert_allclose(places[station], [x, y, half_turns * math.pi], atol=1e-12)


def test_matches_outside_the_largest_group_are_not_used(by_sequence, three_room_scans):
    hypotheses = [match("s1", "s2"), match("s3", "s4"), match("s4", "s5")]
    result = select_matches(three_room_scans, hypotheses, (), by_sequence, adjust=leave)
    assert list(result.placement) == ["s3", "s4", "s5"]
    assert [(u.target, u.source) for u in result.used] == [("s3", "s4"), ("s4", "s5")]
    assert [row.rejection for row in result.matches] == ["s1 is not placed", None, None]


@pytest.mark.parametrize("placement", ["evidence", "sequence"])
@pytest.mark.parametrize("count", [0, 1])
def test_nothing_to_choose_from_is_no_error(three_room_scans, settings, placement, count):
    scans = dict(list(three_room_scans.items())[:count])
    chosen = settings.model_copy(update={"placement": placement})
    result = select_matches(scans, (), (), chosen, adjust=leave)
    assert result.used == result.matches == ()
    assert len(result.placement) <= count
