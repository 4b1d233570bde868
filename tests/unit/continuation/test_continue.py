"""A station added to a solved survey: nothing old is matched again, and the answer is the same."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb import evaluate_solution, solve_survey
from slam_uwb.continuation import earlier_matches
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.solution import Status


def largest_gap(a, b):
    """m, between the places of two solutions in one frame."""
    gaps = [s.pose.distance_to(t.pose) for s, t in zip(a.stations, b.stations, strict=True)]
    gaps += [
        float(np.linalg.norm(s.position - t.position))
        for s, t in zip(a.anchors, b.anchors, strict=True)
        if s.position is not None or t.position is not None
    ]
    return max(gaps)


def used(solution):
    return {match.ends: match for match in solution.matches if match.rejection is None}


def test_only_the_new_station_is_matched(continued, matched):
    """Five pairs of the sixth station, not all fifteen; the ten before are in the solution as well."""
    assert matched["matching scans"] == 5
    pairs = {match.ends for match in continued.matches}
    assert any("s06" in pair for pair in pairs)
    assert any("s06" not in pair for pair in pairs)


def test_the_earlier_matches_are_kept(earlier, continued):
    before, now = used(earlier), used(continued)
    assert {pair for pair in now if "s06" not in pair} == set(before)
    for pair, match in before.items():
        np.testing.assert_array_equal(now[pair].covariance, match.covariance)
        # What its walls hold is as it was; along what they leave free it follows the placement.
        values, axes = np.linalg.eigh(match.covariance)
        step = (match.target_T_source.inverse() @ now[pair].target_T_source).vector
        assert np.abs(axes[:, values < 0.05**2].T @ step).max() < 1e-4


def test_the_station_stands_where_it_stood(flat, continued):
    evaluation = evaluate_solution(continued, flat.reference)
    assert evaluation.stations.not_ok == ()
    assert evaluation.stations.ok_errors.max < 0.02


def test_it_is_the_answer_of_the_same_matches_from_scratch(flat, continued):
    """With nothing new the placement is built from the matches alone, along their spanning tree."""
    again = solve_survey(flat.survey, earlier=continued)
    assert used(again).keys() == used(continued).keys()
    assert largest_gap(continued, again) < 1e-4
    assert again.continued.added == ()
    assert max(m.distance for m in again.continued.moves if not math.isnan(m.distance)) < 1e-4


def test_a_wrong_start_leads_to_the_same_answer(flat, continued):
    """Stored poses are never used: the matches alone make the map."""
    lost = replace(
        continued,
        stations=tuple(replace(s, pose=Pose2(9.0, 9.0, 1.0)) for s in continued.stations),
    )
    assert largest_gap(continued, solve_survey(flat.survey, earlier=lost)) < 1e-4


def test_all_matched_again_is_millimetres_away(flat, continued):
    assert largest_gap(continued, solve_survey(flat.survey)) < 0.005


def test_it_says_what_moved(earlier, continued):
    moves = continued.continued
    assert moves.added == ("s06",)
    assert moves.seen_from is None
    assert [m.id for m in moves.moves if m.kind == "station"] == ["s01", "s02", "s03", "s04", "s05"]
    old = {a.id: a for a in earlier.anchors}
    compared = 0
    for anchor in continued.anchors:
        move = next(m for m in moves.moves if (m.kind, m.id) == ("anchor", anchor.id))
        assert (move.status_before, move.status_after) == (old[anchor.id].status, anchor.status)
        if anchor.position is None or old[anchor.id].position is None:
            assert math.isnan(move.distance)
            continue
        compared += 1
        by = anchor.position - old[anchor.id].position
        assert move.distance == pytest.approx(math.hypot(*by))
        assert move.after**2 == pytest.approx(max(np.linalg.eigvalsh(anchor.covariance)))
    assert compared >= 3


def test_a_station_that_had_no_place_may_find_one(flat, earlier):
    """As if nothing had held the fifth: its pairs are open again, without being matched again."""
    lost = replace(
        earlier,
        matches=tuple(
            replace(m, rejection="s05 is not placed") if "s05" in m.ends else m
            for m in earlier.matches
        ),
    )
    matched = {}
    solution = solve_survey(
        flat.survey, earlier=lost, progress=lambda what, _, total: matched.update({what: total})
    )
    assert matched["matching scans"] == 5
    assert solution.stations[4].status is Status.OK
    assert any("s05" in pair for pair in used(solution))


def test_the_frame_stays_aligned(flat, earlier, continued):
    """An earlier solution turned by --align is continued in its turned frame, and moves compare."""
    turned = Pose2(10.0, 20.0, 1.0)
    moved = replace(
        earlier,
        alignment=turned,
        stations=tuple(replace(s, pose=turned @ s.pose) for s in earlier.stations),
        anchors=tuple(
            a if a.position is None else replace(a, position=turned.transform(a.position))
            for a in earlier.anchors
        ),
    )
    solution = solve_survey(flat.survey, earlier=moved)
    assert solution.alignment == turned
    for a, b in zip(solution.stations, continued.stations, strict=True):
        assert a.pose.distance_to(turned @ b.pose) < 1e-4
    for a, b in zip(solution.continued.moves, continued.continued.moves, strict=True):
        assert a.distance == pytest.approx(b.distance, abs=1e-4, nan_ok=True)
    other = solve_survey(flat.survey, earlier=moved, align="walls")
    assert other.continued.seen_from == "s01"
    for a, b in zip(other.continued.moves, continued.continued.moves, strict=True):
        assert a.distance == pytest.approx(b.distance, abs=1e-4, nan_ok=True)


def test_without_an_earlier_solution_everything_is_open():
    known, pairs = earlier_matches(None), (("a", "b"), ("b", "c"))
    assert known.unmatched(pairs) == known.open(pairs) == pairs
    assert known.firm(()) == known.hypotheses == ()
