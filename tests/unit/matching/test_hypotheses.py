import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.hypotheses import describe_match, match_pair
from slam_uwb.model.geometry import Pose2

SIDE_BY_SIDE = [("s1", "s2"), ("s2", "s3"), ("s3", "s4"), ("s4", "s5"), ("s5", "s6"), ("s6", "s7")]


def truth_of(poses, pair):
    return poses[pair[0]].inverse() @ poses[pair[1]]


@pytest.mark.parametrize("pair", [p for p in SIDE_BY_SIDE if p != ("s4", "s5")])
def test_the_best_hypothesis_of_overlapping_scans_is_the_truth(
    three_room_scans, three_room_poses, error, settings, pair
):
    best = match_pair(*(three_room_scans[s] for s in pair), settings)[0]
    assert error(best.target_T_source, truth_of(three_room_poses, pair))[:2].max() < 0.02
    assert (best.target, best.source, best.rank, best.rejection) == (*pair, 0, None)
    assert best.overlap > 0.3
    assert best.violation < 0.01
    assert not best.degenerate


def test_the_truth_is_among_the_hypotheses_of_any_pair_of_neighbouring_rooms(
    three_room_hypotheses, three_room_poses
):
    for pair in [("s1", "s3"), ("s2", "s4"), ("s3", "s5"), ("s4", "s6"), ("s5", "s7")]:
        found = [m for m in three_room_hypotheses if (m.target, m.source) == pair]
        truth = truth_of(three_room_poses, pair)
        assert min(m.target_T_source.distance_to(truth) for m in found) < 0.05


def test_hypotheses_are_ranked_distinct_and_worth_keeping(three_room_hypotheses, settings):
    pairs = {(m.target, m.source) for m in three_room_hypotheses}
    for pair in pairs:
        found = [m for m in three_room_hypotheses if (m.target, m.source) == pair]
        assert [m.rank for m in found] == list(range(len(found)))
        assert len(found) <= settings.hypotheses
        scores = [m.score for m in found]
        assert scores == sorted(scores, reverse=True)
        assert scores[-1] >= settings.min_evidence_m
        for i, a in enumerate(found):
            for b in found[:i]:
                a_T_b = a.target_T_source.inverse() @ b.target_T_source
                assert a_T_b.distance_to(Pose2.identity()) > 0.1 or abs(a_T_b.theta) > 0.05
        for match in found:
            assert 0.0 <= match.overlap <= 1.0
            assert 0.0 <= match.violation <= 1.0
            assert match.overlap + match.violation <= 1.0 + 1e-12
            assert np.linalg.eigvalsh(match.covariance).min() > 0.0


def test_fewer_hypotheses_are_the_best_of_more(three_room_scans, settings):
    pair = [three_room_scans[s] for s in ("s1", "s3")]
    best = match_pair(*pair, settings.model_copy(update={"hypotheses": 1}))
    assert len(best) == 1
    assert (
        best[0].target_T_source.distance_to(match_pair(*pair, settings)[0].target_T_source) < 0.01
    )


def test_equal_places_have_equal_hypotheses(view, settings):
    """A square room looks the same at every quarter turn: four hypotheses, and no way to tell."""
    square = [((0, 0), (4, 0)), ((4, 0), (4, 4)), ((4, 4), (0, 4)), ((0, 4), (0, 0))]
    a, b = Pose2(2.2, 1.4, 0.3), Pose2(1.1, 2.5, 1.0)
    found = match_pair(view("a", square, a), view("b", square, b), settings)[:4]
    quarter = Pose2(2.0, 2.0, 0.0) @ Pose2(0, 0, math.pi / 2) @ Pose2(2.0, 2.0, 0.0).inverse()
    places, turned = [], b
    for _ in range(4):
        places.append(a.inverse() @ turned)
        turned = quarter @ turned
    for place in places:
        assert min(m.target_T_source.distance_to(place) for m in found) < 0.01
    scores = [m.score for m in found]
    assert max(scores) - min(scores) < 0.05 * max(scores)


def test_scans_that_share_nothing_have_no_hypothesis(view, settings):
    stub, curve = [((2, -0.3), (2, 0.3))], [((3, 0), (2.5, 2)), ((2.5, 2), (1, 3))]
    pair = view("a", stub, Pose2.identity()), view("b", curve, Pose2.identity())
    strict = settings.model_copy(update={"min_evidence_m": 3.0})
    assert match_pair(*pair, strict) == ()


def test_the_papers_ranking_is_by_the_number_of_close_points(three_room_scans, settings):
    """A match that brings more points together goes first, even through walls."""
    from slam_uwb.matching.landmark import closest_point_count

    paper = settings.model_copy(update={"ranking": "closest_points", "refiner": "paper_lm"})
    for pair in SIDE_BY_SIDE[:3]:
        target, source = (three_room_scans[s] for s in pair)
        found = match_pair(target, source, paper)
        poses = np.array([m.target_T_source.vector for m in found])
        counts = closest_point_count(target, source, poses, paper.closest_point_m)
        assert len(found) > 1
        assert (np.diff(counts) <= 0).all()


def test_a_match_is_described_by_its_own_pose(three_room_scans, three_room_poses, settings):
    pose = truth_of(three_room_poses, ("s1", "s2"))
    match = describe_match(three_room_scans["s1"], three_room_scans["s2"], pose.vector, 3, settings)
    assert (match.target, match.source, match.rank) == ("s1", "s2", 3)
    assert match.target_T_source == pose
    swapped = describe_match(
        three_room_scans["s2"], three_room_scans["s1"], pose.inverse().vector, 0, settings
    )
    for name in ("overlap", "violation", "score"):
        assert getattr(swapped, name) == pytest.approx(getattr(match, name))


def test_matches_are_values(three_room_hypotheses):
    match = three_room_hypotheses[0]
    with pytest.raises(ValueError, match="read-only"):
        match.covariance[0, 0] = 0.0
    assert replace(match, rank=5).rank == 5
