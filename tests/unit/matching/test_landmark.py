import math
import tracemalloc
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from slam_uwb.matching import landmark
from slam_uwb.matching.landmark import closest_point_count, fit_triples, landmark_matches
from slam_uwb.model.geometry import Pose2

PAPER = {"initial_matches": 5}


@pytest.fixture
def five(settings):
    return settings.model_copy(update=PAPER)


def with_landmarks(index, landmarks):
    return replace(index, scan=replace(index.scan, landmarks=landmarks))


def test_triples_are_fitted_exactly():
    rng = np.random.default_rng(0)
    poses = rng.uniform([-20, -20, -math.pi], [20, 20, math.pi], (200, 3))
    source = rng.uniform(-10, 10, (200, 3, 2))
    target = np.array(
        [Pose2.from_vector(p).transform(s) for p, s in zip(poses, source, strict=True)]
    )
    fitted = fit_triples(target, source)
    np.testing.assert_allclose(fitted[:, :2], poses[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * fitted[:, 2]), np.exp(1j * poses[:, 2]), atol=1e-10)


def test_unequal_triples_are_fitted_by_least_squares():
    """No pose nearby has a smaller sum of squares."""
    rng = np.random.default_rng(1)
    source = rng.uniform(-5, 5, (3, 2))
    target = Pose2(1.0, -2.0, 2.5).transform(source) + rng.normal(0.0, 0.1, (3, 2))
    best = Pose2.from_vector(fit_triples(target[None], source[None])[0])

    def cost(pose):
        return ((pose.transform(source) - target) ** 2).sum()

    for step in np.concatenate([np.eye(3), -np.eye(3)]) * 1e-3:
        assert cost(best) < cost(best @ Pose2.from_vector(step))


@pytest.mark.parametrize("seed", range(6))
def test_the_truth_is_among_the_five_best(view, room, error, five, seed):
    rng = np.random.default_rng(seed)
    a, b = (
        Pose2(rng.uniform(1.5, 3.5), rng.uniform(1.2, 2.6), rng.uniform(-math.pi, math.pi))
        for _ in range(2)
    )
    found = landmark_matches(view("a", room, a), view("b", room, b), five)
    assert found.shape == (5, 3)
    # Landmarks of exact scans are exact, and so is the pose of three of them.
    assert min(error(pose, a.inverse() @ b).max() for pose in found) < 1e-6


def test_the_truth_is_found_from_noisy_landmarks(view, three_rooms, three_room_poses, error, five):
    rng = np.random.default_rng(2)
    poses = three_room_poses
    for target, source in [("s1", "s2"), ("s3", "s4"), ("s4", "s5"), ("s6", "s7")]:
        a, b = (view(s, three_rooms, poses[s], rng, 0.005) for s in (target, source))
        truth = poses[target].inverse() @ poses[source]
        errors = np.array([error(pose, truth) for pose in landmark_matches(a, b, five)])
        assert ((errors[:, :2].max(axis=1) < 0.2) & (errors[:, 2] < math.radians(4))).any()


def test_the_order_of_the_landmarks_does_not_matter(view, room, five):
    """Triples of either orientation are brought into one, so that cyclic shifts are all there is."""
    a, b = view("a", room, Pose2(2.0, 1.5, 0.5)), view("b", room, Pose2(3.0, 2.2, -2.0))
    truth = landmark_matches(a, b, five)[0]
    rng = np.random.default_rng(3)
    corners = b.scan.landmarks[:3]
    for _ in range(6):
        # Three landmarks make one triple: in a wrong orientation it corresponds to nothing.
        shuffled = with_landmarks(b, rng.permutation(corners))
        np.testing.assert_allclose(landmark_matches(a, shuffled, five)[0], truth, atol=1e-6)


def test_mirrored_landmarks_do_not_correspond(view, room, five):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    triangle = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    a, b = with_landmarks(index, triangle), with_landmarks(index, triangle * [1.0, -1.0])
    assert landmark_matches(a, a, five).shape == (1, 3)
    assert landmark_matches(a, b, five).shape == (0, 3)


@pytest.mark.parametrize(("stretch", "found"), [(0.0, 1), (0.09, 1), (0.11, 0)])
def test_sides_may_differ_by_ten_centimetres(view, room, five, stretch, found):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    triangle = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    longer = triangle + np.array([[0.0, 0.0], [stretch, 0.0], [0.0, 0.0]])
    a, b = with_landmarks(index, triangle), with_landmarks(index, longer)
    assert len(landmark_matches(a, b, five)) == found


def test_a_triangle_of_equal_sides_corresponds_in_three_ways(view, room, five):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    equal = np.array([[math.cos(t), math.sin(t)] for t in np.radians([0, 120, 240])])
    turns = landmark_matches(with_landmarks(index, equal), with_landmarks(index, equal), five)
    np.testing.assert_allclose(
        np.sort(np.remainder(turns[:, 2] + 0.1, 2 * math.pi) - 0.1),
        np.radians([0, 120, 240]),
        atol=1e-9,
    )


def test_best_first_by_the_number_of_close_points(three_room_scans, five):
    a, b = three_room_scans["s3"], three_room_scans["s4"]
    counts = closest_point_count(a, b, landmark_matches(a, b, five), five.closest_point_m)
    assert (np.diff(counts) <= 0).all()


def test_close_points_are_counted(view, room, settings):
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.0, -2.0)
    target, source = view("a", room, a), view("b", room, b)
    truth = a.inverse() @ b
    poses = np.array([(truth @ Pose2(d, 0.0, 0.0)).vector for d in (0.0, 0.3, 2.0, 50.0)])
    counted = closest_point_count(target, source, poses, settings.closest_point_m)
    for pose, count in zip(poses, counted, strict=True):
        moved = Pose2.from_vector(pose).transform(source.scan.points)
        apart = np.linalg.norm(moved[:, None] - target.scan.points[None], axis=2).min(axis=1)
        # The table may miss the nearest point by its cells.
        assert (apart < 0.4 - 0.15).sum() <= count <= (apart < 0.4).sum()
    assert counted[0] > 340
    assert counted[3] == 0


@pytest.mark.parametrize("most", [1, 100, 1000])
def test_thinning_bounds_the_triples(view, room, settings, monkeypatch, most):
    looked_at = []
    monkeypatch.setattr(
        landmark, "fit_triples", lambda m, n: looked_at.append(len(m)) or fit_triples(m, n)
    )
    many = np.random.default_rng(4).uniform(-6.0, 6.0, (24, 2))
    a = with_landmarks(view("a", room, Pose2(2.0, 1.5, 0.5)), many)
    landmark_matches(a, a, settings)
    landmark_matches(a, a, settings.model_copy(update={"max_triples": most}))
    assert looked_at[0] > 2000
    # Thinned by triples of one scan, which have a few partners each, more or less.
    assert sum(looked_at[1:]) <= 1.5 * most + 20
    assert most == 1 or sum(looked_at[1:]) > 0.5 * most


def test_thinning_is_even_enough_to_keep_the_truth(view, room, settings, error):
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
    thin = settings.model_copy(update={"max_triples": 60})
    found = landmark_matches(view("a", room, a), view("b", room, b), thin)
    assert min(error(pose, a.inverse() @ b).max() for pose in found) < 1e-6


def test_combinations_are_all_and_in_order_until_they_are_too_many():
    for count in range(9):
        expected = np.array(list(combinations(range(count), 3)), dtype=int).reshape(-1, 3)
        np.testing.assert_array_equal(landmark._combinations(count, 100), expected)


def test_too_many_combinations_are_thinned_evenly():
    chosen = landmark._combinations(300, 20_000)
    assert chosen.shape == (20_000, 3)
    assert ((chosen[:, 0] < chosen[:, 1]) & (chosen[:, 1] < chosen[:, 2])).all()
    assert 0 <= chosen.min() < chosen.max() < 300
    assert len(np.unique(chosen, axis=0)) == 20_000
    # Each landmark is in one of a hundred triples: 200 of these, more or less.
    assert np.ptp(np.bincount(chosen.ravel())) < 100


def test_many_landmarks_do_not_take_much_memory_and_the_truth_is_still_found(
    view, room, five, error, monkeypatch
):
    """300 landmarks make 4.5 million triples, 200 MB before anything is compared."""
    monkeypatch.setattr(landmark, "_MOST_TRIPLES", 20_000)
    rng = np.random.default_rng(6)
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
    marks = rng.uniform(-12.0, 12.0, (300, 2))
    target, source = (
        with_landmarks(view(name, room, pose), pose.inverse().transform(marks))
        for name, pose in (("a", a), ("b", b))
    )
    tracemalloc.start()
    found = landmark_matches(target, source, five.model_copy(update={"max_triples": 20_000}))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Mostly the 4096 poses by 360 points that are scored at once.
    assert peak < 250e6
    assert min(error(pose, a.inverse() @ b).max() for pose in found) < 1e-6


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_landmarks_give_no_match(view, room, five, count):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    few = with_landmarks(index, index.scan.landmarks[:count])
    assert landmark_matches(index, few, five).shape == (0, 3)
    assert landmark_matches(few, index, five).shape == (0, 3)
