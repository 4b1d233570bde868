"""What new stations moved, in words, in the verdict and as a table."""

import math

from slam_uwb.model.solution import Continuation, Move, Status
from slam_uwb.report.moves import describe_moves, move_table
from slam_uwb.report.page import draw_report
from slam_uwb.report.trust import judge_anchors
from slam_uwb.report.verdict import judge_solution

OK, LOST = Status.OK, Status.UNREACHABLE


def continued(*moves, added=("s2",), seen_from=None):
    return Continuation("cd", added, seen_from, moves)


def test_the_largest_move_of_each_kind_is_named(make_solution):
    moves = (
        Move("station", "s1", 0.0, 0.0, 0.0, OK, OK),
        Move("station", "s3", 0.0041, 0.01, 0.01, OK, OK),
        Move("anchor", "A", 0.05, 0.1, 0.08, OK, OK),
        Move("anchor", "B", 0.12, 0.1, 0.08, OK, OK),
        Move("anchor", "C", math.nan, math.nan, 0.2, LOST, OK),
    )
    solution = make_solution(continued=continued(*moves, seen_from="s1"))
    first, second = describe_moves(solution)
    assert first == (
        "with s2 added: anchors moved by up to 0.120 m (B), "
        "stations moved by up to 0.004 m (s3), as seen from station s1"
    )
    assert second == "anchor C: unreachable before, ok now"
    page = draw_report(solution)
    assert "Continued from an earlier solution with s2 added: anchors" in page
    assert '<section id="moves">' in page


def test_from_scratch_there_is_nothing_to_tell(make_solution):
    solution = make_solution()
    assert list(describe_moves(solution)) == []
    assert move_table(solution).rows == ()
    assert 'id="moved"' not in draw_report(solution)


def test_nothing_new_and_nothing_placed(make_solution):
    lost = Move("anchor", "C", math.nan, math.nan, math.nan, LOST, LOST)
    assert list(describe_moves(make_solution(continued=continued(lost, added=())))) == [
        "without new station: nothing to compare"
    ]


def test_a_new_station_without_a_place_is_told(make_solution):
    first, *others = make_solution().stations
    lost = type(first)(first.id, None, None, Status.DISCONNECTED)
    solution = make_solution(stations=(lost, *others), continued=continued(added=(first.id,)))
    assert f"{first.id} is disconnected in the earlier map: solve without --continue" in list(
        describe_moves(solution)
    )


def test_a_move_beyond_three_sigmas_is_a_finding(make_solution):
    """0.31 m with 0.1 m before is one; 0.29 m, or 9 mm of an exact station, or of what was in doubt, is none."""
    moves = (
        Move("anchor", "A", 0.31, 0.1, 0.1, OK, OK),
        Move("anchor", "B", 0.29, 0.1, 0.1, OK, OK),
        Move("station", "s1", 0.009, 0.0, 0.0, OK, OK),
        Move("anchor", "C", 5.0, 0.5, 0.1, Status.WEAK_GEOMETRY, OK),
    )
    solution = make_solution(continued=continued(*moves))
    texts = [f.text for f in judge_solution(solution, judge_anchors(solution)).findings]
    assert [text for text in texts if "since the earlier solution" in text] == [
        "anchor A moved by 0.31 m since the earlier solution, which gave it 0.20 m (2 sigma)"
    ]
    table = move_table(solution)
    moved = table.columns.index("moved")
    assert [row.cells[moved].mark for row in table.rows] == ["bad", "", "", "bad"]
    assert [row.cells[moved].value for row in table.rows] == [0.31, 0.29, 0.009, 5.0]
