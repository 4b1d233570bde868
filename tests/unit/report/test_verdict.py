"""One word on a survey, and whom to trust: every fault is named, and nothing else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.solution import SolverChecks, Status
from slam_uwb.report.trust import Trust, describe_geometry, judge_anchors, widest_gap
from slam_uwb.report.verdict import Level, judge_solution


def judge(solution):
    return judge_solution(solution, judge_anchors(solution))


def texts(verdict):
    return "\n".join(finding.text for finding in verdict.findings)


def test_nothing_wrong_is_good_and_says_how_good(make_solution):
    verdict = judge(make_solution())
    assert verdict.level is Level.GOOD
    assert not verdict.findings
    # The least certain: two sigmas of a variance of 0.01 m^2.
    assert "3 of 3 anchors can be trusted, the least certain of them to 0.20 m" in verdict.summary


@pytest.mark.parametrize("status", [status for status in Status if status is not Status.OK])
def test_an_anchor_that_is_not_ok_is_not_to_be_used_and_has_its_advice(make_solution, status):
    solution = make_solution()
    bad = replace(solution.anchors[0], status=status)
    # Four, so that three are left.
    solution = make_solution(
        anchors=(bad, *solution.anchors[1:], replace(bad, id="D", status=Status.OK))
    )
    assert judge_anchors(solution)[0].trust is Trust.NO
    verdict = judge(solution)
    assert verdict.level is Level.USABLE
    (finding,) = verdict.findings
    assert finding.text.startswith("anchor A: ")
    assert finding.advice


def test_fewer_than_three_anchors_are_measured_again(make_solution, mirrored):
    solution = make_solution()
    solution = make_solution(anchors=(solution.anchors[0], mirrored, solution.anchors[2]))
    verdict = judge(solution)
    assert verdict.level is Level.AGAIN
    assert "only 2 of 3 anchors have a place" in texts(verdict)


def test_a_place_nobody_found_is_never_trusted(make_solution):
    """Whatever its status says."""
    gone = replace(make_solution().anchors[0], position=None, covariance=None)
    assert judge_anchors(make_solution(anchors=(gone,)))[0].trust is Trust.NO


@pytest.mark.parametrize("covariance", [np.diag([0.01, 0.08]), np.diag([np.nan, 0.01])])
def test_an_uncertain_anchor_is_to_be_checked(make_solution, covariance):
    """2 sqrt(0.08) = 0.57 m is more than the 0.5 m; and a covariance that is no number is not small."""
    solution = make_solution()
    unsure = replace(solution.anchors[0], covariance=covariance)
    judged = judge_anchors(make_solution(anchors=(unsure, *solution.anchors[1:])))
    assert [item.trust for item in judged] == [Trust.CHECK, Trust.YES, Trust.YES]


def test_an_anchor_without_line_of_sight_is_to_be_checked(make_solution):
    links = [
        replace(k, nlos_probability=0.9) if k.anchor == "A" else k for k in make_solution().links
    ]
    judged = judge_anchors(make_solution(links=tuple(links)))
    assert judged[0].trust is Trust.CHECK
    assert judged[0].through_walls == 1.0
    one_in_sight = [replace(links[0], nlos_probability=0.1), *links[1:]]
    assert judge_anchors(make_solution(links=tuple(one_in_sight)))[0].trust is Trust.YES


def test_an_anchor_that_half_of_its_links_contradict_is_to_be_checked(make_solution):
    wrong = {"s1", "s2"}
    links = [
        replace(k, rejection="1.50 m too long for the place that the other ranges give")
        if k.anchor == "B" and k.station in wrong
        else k
        for k in make_solution().links
    ]
    solution = make_solution(links=tuple(links))
    judged = judge_anchors(solution)[1]
    assert judged.trust is Trust.CHECK
    assert (len(judged.used), len(judged.rejected)) == (2, 2)
    assert "s1 to B (+0.01 m), s2 to B (+0.01 m)" in texts(judge(solution))


def test_swapped_identifiers_are_called_out_by_station_and_anchors(make_solution):
    reason = "fits anchor {}: identifiers swapped at this station"
    other = {"A": "B", "B": "A"}
    links = [
        replace(k, rejection=reason.format(other[k.anchor]))
        if k.station == "s2" and k.anchor in other
        else k
        for k in make_solution().links
    ]
    verdict = judge(make_solution(links=tuple(links)))
    assert verdict.level is Level.USABLE
    (finding,) = verdict.findings
    assert "at station s2 the ranges of anchors A and B look swapped" in finding.text
    assert "exchange A and B in its rows of ranges.csv" in finding.advice


def test_two_pairs_swapped_at_one_station_are_two_findings(make_solution, make_link):
    reason = "fits anchor {}: identifiers swapped at this station"
    other = {"A": "B", "B": "A", "C": "D", "D": "C"}
    links = [make_link("s1", name, rejection=reason.format(other[name])) for name in other]
    found = texts(judge(make_solution(links=tuple(links))))
    assert "anchors A and B look swapped" in found
    assert "anchors C and D look swapped" in found
    assert "A and C" not in found


def test_lost_stations_are_named_and_most_of_them_lost_is_measured_again(make_solution):
    stations = make_solution().stations
    lost = [replace(s, pose=None, covariance=None, status=Status.DISCONNECTED) for s in stations]
    verdict = judge(make_solution(stations=(lost[0], *stations[1:])))
    assert verdict.level is Level.USABLE
    assert "station s1: nothing holds it" in texts(verdict)
    verdict = judge(make_solution(stations=(*lost[:3], stations[3])))
    assert verdict.level is Level.AGAIN
    assert "stations s1, s2, s10: nothing holds" in texts(verdict)


@pytest.mark.parametrize(
    ("gap", "level"), [(0.0009, Level.GOOD), (0.002, Level.USABLE), (0.02, Level.AGAIN), (math.nan, Level.AGAIN)]
)  # fmt: skip
def test_a_solution_that_is_not_confirmed_is_not_good(make_solution, gap, level):
    for checks in (SolverChecks(gap, 0.0, 3, 1.0), SolverChecks(0.0, gap, 3, 1.0)):
        assert judge(make_solution(checks=checks)).level is level


def test_warnings_of_the_solver_are_findings(make_solution):
    assert "beware" in texts(judge(make_solution(warnings=("beware",))))


def test_widest_gap_by_hand():
    """Seen from the origin at 0, 90 and 180 degrees: nobody below. One alone leaves the whole circle."""
    others = np.array([(1.0, 0.0), (0.0, 2.0), (-3.0, 0.0)])
    assert widest_gap(np.zeros(2), others) == pytest.approx(math.pi)
    assert widest_gap(np.zeros(2), others[:1]) == pytest.approx(2 * math.pi)
    assert math.isnan(widest_gap(np.zeros(2), np.empty((0, 2))))


def test_geometry_in_words(make_solution):
    """A is in the middle of the stations; B is beside them."""
    a, b, _ = judge_anchors(make_solution())
    assert describe_geometry(a).startswith("all round")
    # From (4, 1): s2 and s10 at (-1, +-1), so they span 90 degrees.
    assert describe_geometry(b) == "several sides (90°)"
