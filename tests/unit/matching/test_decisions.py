"""What a person decided is obeyed, and what the scans say against it is told."""

import numpy as np
import pytest

from slam_uwb.matching import decide_pairs, review_pairs, select_matches
from slam_uwb.matching.decisions import DROPPED
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import Decision


def leave(placement, matches):
    """The pose graph of these tests: everything stays where it is."""
    return dict(placement)


@pytest.fixture
def solve(three_room_scans, three_room_hypotheses, three_room_pairs, settings):
    """The selection and the outcomes under some decisions."""

    def run(*decisions, hypotheses=three_room_hypotheses, changes=None):
        chosen = settings.model_copy(update=changes or {})
        decided = decide_pairs(decisions, three_room_pairs, hypotheses, three_room_scans, chosen)
        selection = select_matches(
            three_room_scans, decided.hypotheses, decided.pairs, chosen, adjust=leave, firm=decided.firm
        )  # fmt: skip
        outcomes = review_pairs(decisions, decided, selection.placement, chosen)
        return selection, decided, outcomes

    return run


def true_pose(poses, a, b):
    return poses[a].inverse() @ poses[b]


def used_pairs(selection):
    return {frozenset((m.target, m.source)) for m in selection.used}


def test_without_decisions_nothing_changes(solve, three_room_pairs, three_room_hypotheses):
    _, decided, outcomes = solve()
    assert decided.pairs == three_room_pairs
    assert decided.hypotheses == three_room_hypotheses
    assert (decided.firm, decided.dropped, outcomes) == ((), (), ())


@pytest.mark.parametrize("ends", [("s1", "s2"), ("s2", "s1")])
def test_a_dropped_pair_is_not_used_and_its_rows_say_why(solve, ends):
    free, _, _ = solve()
    assert frozenset(ends) in used_pairs(free)
    selection, decided, (outcome,) = solve(Decision("pair", *ends, "drop"))
    assert frozenset(ends) not in used_pairs(selection)
    assert {h.rejection for h in decided.dropped} == {DROPPED}
    assert all({h.target, h.source} == set(ends) for h in decided.dropped)
    # Both stations are placed through others, where the dropped match would have put them.
    assert "agrees with the map of all the others" in outcome.contradiction


def test_dropping_all_that_holds_a_station_leaves_it_out(solve, three_room_scans):
    drops = [Decision("pair", "s1", other, "drop") for other in three_room_scans if other != "s1"]
    selection, _, outcomes = solve(*drops)
    assert "s1" not in selection.placement
    # Nothing contradicts what nothing else says.
    assert [o.contradiction for o in outcomes] == [None] * len(drops)


def test_a_guess_is_refined_and_places_a_pair_that_no_search_found(
    solve, three_room_hypotheses, three_room_poses
):
    """Without any hypothesis of s1, a rough pose by hand brings it to where it belongs."""
    without = tuple(h for h in three_room_hypotheses if "s1" not in (h.target, h.source))
    lost, _, _ = solve(hypotheses=without)
    assert "s1" not in lost.placement
    truth = true_pose(three_room_poses, "s2", "s1")
    rough = truth @ Pose2(0.25, -0.2, 0.08)
    selection, decided, (outcome,) = solve(
        Decision("pair", "s2", "s1", "guess", rough), hypotheses=without
    )
    assert decided.firm[0].target_T_source.distance_to(truth) < 0.02
    placed = selection.placement["s2"].inverse() @ selection.placement["s1"]
    assert placed.distance_to(truth) < 0.02
    assert (outcome.effect, outcome.contradiction) == ("used", None)


@pytest.mark.parametrize("placement", ["evidence", "sequence"])
def test_a_guess_against_all_evidence_is_obeyed_and_flagged(
    solve, three_room_hypotheses, three_room_poses, placement
):
    """30 m away no wall is shared: the guess stays as it is, with the sigmas of a fit by hand."""
    without = tuple(h for h in three_room_hypotheses if "s1" not in (h.target, h.source))
    far = Pose2(-30.0, 5.0, 1.0)
    selection, decided, (outcome,) = solve(
        Decision("pair", "s2", "s1", "guess", far),
        hypotheses=without,
        changes={"placement": placement},
    )
    assert decided.firm[0].target_T_source == far
    np.testing.assert_allclose(np.diag(decided.firm[0].covariance), [0.01, 0.01, 0.0025])
    placed = selection.placement["s2"].inverse() @ selection.placement["s1"]
    assert placed.distance_to(far) < 1e-6
    assert outcome.effect == "used"
    assert "no wall in common" in outcome.contradiction


def test_a_guess_into_walls_says_how_much_was_looked_through(solve, three_room_poses):
    """s2 laid over the next room: its walls stand in the middle of what others looked through."""
    truth = true_pose(three_room_poses, "s3", "s1")
    wrong = truth @ Pose2(0.9, 1.1, 0.9)
    _, decided, (outcome,) = solve(Decision("pair", "s3", "s1", "guess", wrong))
    if decided.firm[0].target_T_source.distance_to(wrong) < 1e-9:
        assert "look through" in outcome.contradiction


@pytest.mark.parametrize("turned", [False, True])
def test_a_kept_pair_is_used_whatever_else_the_map_says(
    solve, three_room_hypotheses, three_room_poses, turned
):
    """A hypothesis a metre from the truth, told by its pose, either way round."""
    wrong = next(
        h
        for h in three_room_hypotheses
        if h.target_T_source.distance_to(true_pose(three_room_poses, h.target, h.source)) > 1.0
    )
    a, b, pose = wrong.target, wrong.source, wrong.target_T_source
    if turned:
        a, b, pose = b, a, pose.inverse()
    selection, decided, (outcome,) = solve(Decision("pair", a, b, "keep", pose))
    assert decided.firm[0].target_T_source.distance_to(wrong.target_T_source) < 1e-9
    assert frozenset((a, b)) in used_pairs(selection)
    placed = selection.placement[wrong.target].inverse() @ selection.placement[wrong.source]
    assert placed.distance_to(wrong.target_T_source) < 0.3
    assert outcome.effect == "used"


def test_keeping_what_is_used_anyway_changes_nothing(solve):
    free, _, _ = solve()
    best = max(free.used, key=lambda m: m.overlap)
    selection, _, (outcome,) = solve(Decision("pair", best.target, best.source, "keep"))
    assert used_pairs(selection) == used_pairs(free)
    assert (outcome.effect, outcome.contradiction) == ("used", None)
    for station, pose in free.placement.items():
        assert pose.distance_to(selection.placement[station]) < 0.01


def test_what_cannot_be_kept_says_so(solve, three_room_hypotheses):
    without = tuple(h for h in three_room_hypotheses if {h.target, h.source} != {"s1", "s2"})
    _, decided, (outcome,) = solve(Decision("pair", "s1", "s2", "keep"), hypotheses=without)
    assert decided.firm == ()
    assert outcome.effect == "not used"
    assert outcome.contradiction
    _, _, (outcome,) = solve(Decision("pair", "s1", "no-scan", "guess", Pose2(1.0, 0.0, 0.0)))
    assert outcome.effect == "not used"


def test_decisions_about_links_are_not_for_here(solve):
    _, decided, outcomes = solve(Decision("link", "s1", "A1", "drop"))
    assert outcomes == ()
    assert decided.dropped == ()
