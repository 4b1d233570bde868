import math
from itertools import combinations

import numpy as np
import pytest

from slam_uwb.graph import adjust_placement
from slam_uwb.matching import select_matches
from slam_uwb.matching.outliers import worst_outliers
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import ScanMatch

PLACES = {name: Pose2(2.0 * k, (k % 2) * 1.5, 0.4 * k) for k, name in enumerate("abcde")}


def pair(target, source, beside=Pose2(0.0, 0.0, 0.0), sigmas=(0.005, 0.005, 0.002)):
    there = PLACES[target].inverse() @ PLACES[source]
    return ScanMatch(
        target, source, there @ beside, np.diag(np.square(sigmas)), 0.5, 0.0, 10.0, rank=0
    )


def ring(**others):
    """All pairs of a to e; `ab=...` in place of the right one."""
    return [others.get(m + n, pair(m, n)) for m, n in combinations("abcde", 2)]


def test_nothing_is_wrong_with_matches_that_agree():
    assert worst_outliers(ring(), PLACES) == frozenset()


@pytest.mark.parametrize(
    "beside",
    [Pose2(0.06, 0.0, 0.0), Pose2(0.0, -0.06, 0.0), Pose2(0.0, 0.0, math.radians(1.0))],
)
def test_a_match_beside_its_place_is_found(beside):
    assert worst_outliers(ring(bd=pair("b", "d", beside)), PLACES) == {frozenset("bd")}


def test_what_a_match_calls_unsure_is_no_outlier():
    # 6 cm along x with a sigma of 7 cm there; the same across, where it is sure to 5 mm, is one.
    sigmas = (0.07, 0.005, 0.002)
    along = pair("b", "d", Pose2(0.06, 0.0, 0.0), sigmas)
    across = pair("b", "d", Pose2(0.0, 0.06, 0.0), sigmas)
    assert worst_outliers(ring(bd=along), PLACES) == frozenset()
    assert worst_outliers(ring(bd=across), PLACES) == {frozenset("bd")}


def test_of_two_at_one_station_the_worse_goes_first():
    two = ring(
        bd=pair("b", "d", Pose2(0.09, 0.0, 0.0)),
        bc=pair("b", "c", Pose2(0.05, 0.0, 0.0)),
        ae=pair("a", "e", Pose2(0.05, 0.0, 0.0)),
    )
    assert worst_outliers(two, PLACES) == {frozenset("bd"), frozenset("ae")}


def test_the_only_match_of_a_station_stays():
    lonely = [m for m in ring() if "e" not in m.ends]
    lonely.append(pair("a", "e", Pose2(0.2, 0.0, 0.0)))
    assert worst_outliers(lonely, PLACES) == frozenset()


def test_what_somebody_decided_stays():
    matches = ring(bd=pair("b", "d", Pose2(0.2, 0.0, 0.0)))
    assert worst_outliers(matches, PLACES, [frozenset("bd")]) == frozenset()


def test_a_survey_is_solved_without_them_and_says_so(
    three_room_scans, three_room_hypotheses, three_room_pairs, three_room_poses, settings,
    monkeypatch,
):  # fmt: skip
    """A pair that matching again puts 8 cm beside: out of the graph, with its reason, nothing else."""
    from slam_uwb.matching import selection

    right = selection.rematch_pairs

    def beside(*args, **kwargs):
        return tuple(
            m
            if m.ends != {"s1", "s2"}
            else ScanMatch(
                m.target, m.source, m.target_T_source @ Pose2(0.08, 0.0, 0.0),
                np.eye(3) * 1e-5, m.overlap, m.violation, m.score, m.rank,
            )
            for m in right(*args, **kwargs)
        )  # fmt: skip

    monkeypatch.setattr(selection, "rematch_pairs", beside)
    result = select_matches(
        three_room_scans, three_room_hypotheses, three_room_pairs, settings,
        adjust=adjust_placement,
    )  # fmt: skip
    assert {"s1", "s2"} not in [m.ends for m in result.used]
    rows = [row.rejection for row in result.matches if row.ends == {"s1", "s2"}]
    assert "fits beside where the other matches have it" in rows
    first = next(iter(result.placement))
    for station, pose in result.placement.items():
        truth = three_room_poses[first].inverse() @ three_room_poses[station]
        assert pose.distance_to(truth) < 0.015
