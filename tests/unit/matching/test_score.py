import numpy as np
import pytest

from slam_uwb.matching.score import point_evidence, score_matches
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B


def scores_at(target, source, pose, settings, **kwargs):
    scores = score_matches(target, source, pose.vector[None], settings, **kwargs)
    return scores.confirmed[0], scores.through[0], scores.total, scores.evidence[0]


@pytest.fixture(scope="module")
def pair(view, room):
    return view("a", room, A), view("b", room, B)


def test_the_truth_is_confirmed_and_looks_through_nothing(pair, settings):
    confirmed, through, total, evidence = scores_at(*pair, TRUTH, settings)
    assert through == 0.0
    # All but the corners, where normals are no guide, of both scans' walls.
    assert 0.8 * total < confirmed <= total
    assert evidence == confirmed


def test_the_total_is_the_wall_of_both_scans(pair, settings):
    total = scores_at(*pair, TRUTH, settings)[2]
    # Perimeter 21 m, seen twice, but for corners cut and gaps capped.
    assert 40.0 < total <= 42.0


@pytest.mark.parametrize("shift", [(1.0, 0.0, 0.0), (0.0, -0.8, 0.0), (0.0, 0.0, 0.8)])
def test_a_shifted_pose_looks_through_walls(pair, settings, shift):
    confirmed, through, total, evidence = scores_at(*pair, TRUTH @ Pose2(*shift), settings)
    assert through > 0.15 * total
    assert evidence == pytest.approx(confirmed - settings.violation_weight * through)
    assert evidence < 0.5 * scores_at(*pair, TRUTH, settings)[3]


def test_a_small_error_confirms_less_but_looks_through_nothing(pair, settings):
    exact = scores_at(*pair, TRUTH, settings)
    near = scores_at(*pair, TRUTH @ Pose2(0.04, 0.03, 0.0), settings)
    assert near[1] == 0.0
    assert 0.6 * exact[0] < near[0] < 0.97 * exact[0]


@pytest.mark.parametrize(
    "step", [(0, 0, 0), (0.03, -0.02, 0.01), (0.7, 0.4, 0.3), (-1.5, 0.2, 2.0)]
)
def test_both_ways_count_alike(pair, settings, step):
    """Swapping target and source and inverting the pose gives the same totals."""
    pose = TRUTH @ Pose2(*step)
    forth = scores_at(*pair, pose, settings)
    back = scores_at(*pair[::-1], pose.inverse(), settings)
    np.testing.assert_allclose(forth, back, rtol=1e-9)


def test_only_what_one_scan_sees_is_judged_by_the_other(view, settings):
    """A wall behind the target's walls is neither confirmed nor denied."""
    near, far = [((2, -2), (2, 2))], [((6, -1), (6, 1))]
    evidence = point_evidence(
        view("a", near, Pose2.identity()),
        view("b", far, Pose2.identity()),
        np.zeros((1, 3)),
        settings,
    )
    assert not evidence.hit.any()
    assert not evidence.seen_through.any()


def test_a_wall_before_the_targets_walls_is_denied(view, settings):
    near, far = [((2, -1), (2, 1))], [((6, -5), (6, 5))]
    evidence = point_evidence(
        view("a", far, Pose2.identity()),
        view("b", near, Pose2.identity()),
        np.zeros((1, 3)),
        settings,
    )
    assert not evidence.hit.any()
    np.testing.assert_array_equal(evidence.seen_through, 1.0)


def test_where_the_target_saw_nothing_it_denies_nothing(view, settings):
    """No return is unknown, not free: glass, black cloth, too far."""
    near, aside = [((2, -1), (2, 1))], [((-6, -5), (-6, 5))]
    evidence = point_evidence(
        view("a", aside, Pose2.identity()),
        view("b", near, Pose2.identity()),
        np.zeros((1, 3)),
        settings,
    )
    assert not evidence.seen_through.any()


def test_the_two_faces_of_a_wall_do_not_confirm_each_other(view, settings):
    # Seen from x = 0 a wall's face is at x = 2.0, seen from x = 4 at x = 2.1: within reach, but it faces away.
    front, back = [((2.0, -2), (2.0, 2))], [((2.1, -2), (2.1, 2))]
    target = view("a", front, Pose2.identity())
    other_side = Pose2(4.0, 0.0, 0.7)
    beside = Pose2(0.0, 0.3, 0.7)
    faces = {"away": (back, other_side), "same": (front, beside)}
    hits = {}
    for name, (walls, place) in faces.items():
        evidence = point_evidence(target, view("b", walls, place), place.vector[None], settings)
        hits[name] = evidence.hit.mean()
        assert not evidence.seen_through.any()
    assert hits["away"] == 0.0
    assert hits["same"] > 0.8


def test_evidence_is_between_none_and_full(three_room_scans, settings):
    rng = np.random.default_rng(0)
    poses = rng.uniform([-6, -6, -3], [6, 6, 3], (200, 3))
    evidence = point_evidence(three_room_scans["s3"], three_room_scans["s4"], poses, settings)
    for values in (evidence.hit, evidence.seen_through):
        assert values.shape == (200, 360)
        assert 0.0 <= values.min() < values.max() <= 1.0
    # A point is not both on a wall and in free space.
    assert (evidence.hit * evidence.seen_through == 0.0).all()


def test_nothing_is_said_of_scans_far_apart(pair, settings):
    confirmed, through, total, evidence = scores_at(*pair, Pose2(500.0, 0.0, 0.0), settings)
    assert (confirmed, through, evidence) == (0.0, 0.0, 0.0)
    assert total > 0.0


def test_a_share_of_the_points_gives_about_the_same(pair, settings):
    for step in (Pose2.identity(), Pose2(0.7, 0.4, 0.3)):
        whole = np.array(scores_at(*pair, TRUTH @ step, settings))
        third = np.array(scores_at(*pair, TRUTH @ step, settings, stride=3))
        np.testing.assert_allclose(third, whole, rtol=0.1, atol=0.5)


def test_the_truth_has_more_evidence_than_any_other_place(pair, settings):
    rng = np.random.default_rng(1)
    poses = rng.uniform([-4, -4, -np.pi], [4, 4, np.pi], (2000, 3))
    away = np.hypot(*(poses[:, :2] - TRUTH.vector[:2]).T) > 0.3
    others = score_matches(*pair, poses[away], settings).evidence
    assert others.max() < 0.5 * scores_at(*pair, TRUTH, settings)[3]


def test_the_weight_of_what_was_looked_through_is_the_setting(pair, settings):
    pose = TRUTH @ Pose2(1.0, 0.0, 0.0)
    confirmed, through, _, _ = scores_at(*pair, pose, settings)
    heavy = settings.model_copy(update={"violation_weight": 4.0})
    assert scores_at(*pair, pose, heavy)[3] == pytest.approx(confirmed - 4.0 * through)
