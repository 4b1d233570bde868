import math

import numpy as np
import pytest

from slam_uwb.matching.batch import compose, transform
from slam_uwb.matching.correspondences import correspondences, partner_count
from slam_uwb.matching.refiners.point_to_line import (
    polish,
    polish_pairs,
    refine_point_to_line,
)
from slam_uwb.matching.score import score_matches
from slam_uwb.model.geometry import Pose2

"""Steps of polishing after which nothing moves."""


def off(truth, distance=0.2, degrees=10.0, direction=0.0):
    step = Pose2(
        distance * math.cos(direction), distance * math.sin(direction), math.radians(degrees)
    )
    return (truth @ step).vector[None]


@pytest.mark.parametrize("direction", np.radians([0, 60, 120, 180, 240, 300]))
@pytest.mark.parametrize("degrees", [10.0, -10.0])
def test_exact_scans_come_together_exactly(view, room, error, settings, direction, degrees):
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
    target, source, truth = view("a", room, a), view("b", room, b), a.inverse() @ b
    refined = refine_point_to_line(target, source, off(truth, 0.2, degrees, direction), settings)
    assert refined.converged.tolist() == [True]
    assert error(refined.poses[0], truth).max() < 1e-3
    refined = polish(target, source, refined.poses, settings, until_still=True)
    assert refined.converged.tolist() == [True]
    assert error(refined.poses[0], truth).max() < 1e-6


def test_the_truth_of_exact_scans_is_left_where_it_is(view, room, error, settings):
    rng = np.random.default_rng(1)
    for _ in range(8):
        a, b = (
            Pose2(rng.uniform(0.7, 3.5), rng.uniform(0.7, 2.5), rng.uniform(-3, 3)) for _ in "ab"
        )
        truth = a.inverse() @ b
        target, source = view("a", room, a), view("b", room, b)
        poses = polish(target, source, truth.vector[None], settings).poses
        # Points at corners, whose normals are wrong, pull a little until they are found to be outliers.
        assert error(poses[0], truth).max() < 1e-3
        poses = polish(target, source, poses, settings, until_still=True).poses
        assert error(poses[0], truth).max() < 1e-6


def test_noisy_scans_come_together_within_their_noise(view, room, error, settings):
    rng = np.random.default_rng(2)
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
    truth = a.inverse() @ b
    for _ in range(10):
        refined = refine_point_to_line(
            view("a", room, a, rng), view("b", room, b, rng), off(truth), settings
        )
        assert refined.converged.all()
        # 10 mm of noise, hundreds of points: millimetres.
        assert error(refined.poses[0], truth)[:2].max() < 0.01
        assert error(refined.poses[0], truth)[2] < math.radians(0.3)


def test_swapped_scans_end_in_the_inverse(view, room, settings):
    rng = np.random.default_rng(3)
    target = view("a", room, Pose2(2.0, 1.5, 0.5), rng)
    source = view("b", room, Pose2(3.0, 2.2, -2.0), rng)
    start = (Pose2(2.0, 1.5, 0.5).inverse() @ Pose2(3.05, 2.2, -1.98)).vector
    forth = polish(target, source, start[None], settings, until_still=True).poses
    back = polish(
        source, target, Pose2.from_vector(start).inverse().vector[None], settings, until_still=True
    ).poses
    round_trip = Pose2.from_vector(forth[0]) @ Pose2.from_vector(back[0])
    np.testing.assert_allclose(round_trip.vector, 0.0, atol=1e-3)


def test_the_two_faces_of_a_wall_are_not_glued_together(view, error, settings):
    """Rooms on either side of a wall 0.12 m thick: nothing but the wall is within the gate of both."""
    left = [((0, 0), (4, 0)), ((4, 0), (4, 4)), ((4, 4), (0, 4)), ((0, 4), (0, 0))]
    right = [((4.12, 0), (9, 0)), ((9, 0), (9, 4)), ((9, 4), (4.12, 4)), ((4.12, 4), (4.12, 0))]
    a, b = Pose2(2.0, 1.7, 0.3), Pose2(6.0, 2.2, -1.0)
    truth = a.inverse() @ b
    poses = refine_point_to_line(
        view("a", left, a), view("b", right, b), truth.vector[None], settings
    ).poses
    # Glued, the rooms would come 0.12 m together.
    assert error(poses[0], truth)[:2].max() < 0.01


def test_a_wall_seen_from_both_sides_through_a_door_keeps_its_thickness(
    view, two_rooms, error, settings
):
    rng = np.random.default_rng(4)
    a, b = Pose2(2.6, 1.6, 0.3), Pose2(5.4, 1.5, -1.0)
    truth = a.inverse() @ b
    for _ in range(5):
        poses = refine_point_to_line(
            view("a", two_rooms, a, rng, 0.005),
            view("b", two_rooms, b, rng, 0.005),
            off(truth, 0.05, 2.0),
            settings,
        ).poses
        assert error(poses[0], truth)[:2].max() < 0.02


@pytest.mark.parametrize("noise", [None, 0.01])
@pytest.mark.parametrize("along", [-0.5, 0.0, 0.7])
def test_a_corridor_does_not_slide_along_its_axis(view, corridor, settings, noise, along):
    """Whatever stands still along the axis comes together across it and in heading."""
    rng = np.random.default_rng(5)
    a, b = Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0)
    for _ in range(6):
        target, source = (
            view(s, corridor, p, rng if noise else None, noise or 0.0, max_range=15.0)
            for s, p in (("a", a), ("b", b))
        )
        start = a.inverse() @ Pose2(b.x + along, b.y + 0.1, b.theta + 0.03)
        refined = refine_point_to_line(target, source, start.vector[None], settings)
        end = a @ Pose2.from_vector(refined.poses[0])
        assert refined.converged.all()
        assert end.x == pytest.approx(b.x + along, abs=0.05)
        assert end.y == pytest.approx(b.y, abs=0.02)
        assert end.angle_to(b) < math.radians(0.5)


def test_an_end_wall_holds_a_corridor_along_its_axis(view, error, settings):
    walls = [((-20, 0), (5, 0)), ((-20, 2), (5, 2)), ((5, 0), (5, 2))]
    a, b = Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0)
    target, source = (view(s, walls, p, max_range=15.0) for s, p in (("a", a), ("b", b)))
    truth = a.inverse() @ b
    poses = refine_point_to_line(target, source, off(truth, 0.2, 3.0, 1.0), settings).poses
    assert (
        error(polish(target, source, poses, settings, until_still=True).poses[0], truth).max()
        < 0.01
    )


def test_candidates_of_a_batch_do_not_touch_one_another(view, room, settings):
    target, source = view("a", room, Pose2(2, 1.5, 0.5)), view("b", room, Pose2(3, 2.2, -2.0))
    truth = Pose2(2, 1.5, 0.5).inverse() @ Pose2(3, 2.2, -2.0)
    starts = np.concatenate([off(truth, 0.1, 3.0, d) for d in (0.0, 2.0, 4.0)])
    together = polish(target, source, starts, settings).poses
    alone = [polish(target, source, start[None], settings).poses[0] for start in starts]
    np.testing.assert_allclose(together, alone, atol=1e-7)


@pytest.mark.parametrize("until_still", [False, True])
def test_pairs_that_are_polished_together_do_not_touch_one_another(
    three_room_scans, three_room_poses, settings, until_still
):
    """Some of them end early; one has nothing in common, and one has fewer points."""
    names = [("s1", "s2"), ("s3", "s4"), ("s1", "s7"), ("s4", "s3"), ("s5", "s6")]
    pairs = [(three_room_scans[a], three_room_scans[b]) for a, b in names]
    off = np.array([[0.03, -0.02, 0.01], [0, 0, 0], [40.0, 0, 0], [-0.05, 0.04, -0.02], [0, 0, 0]])
    truth = [(three_room_poses[a].inverse() @ three_room_poses[b]).vector for a, b in names]
    starts = compose(np.array(truth), off)
    together = polish_pairs(pairs, starts, settings, until_still=until_still)
    assert together.converged.tolist() == [True, True, False, True, True]
    for number, (pair, start) in enumerate(zip(pairs, starts, strict=True)):
        alone = polish(*pair, start[None], settings, until_still=until_still)
        np.testing.assert_allclose(together.poses[number], alone.poses[0], atol=1e-9)
        assert together.iterations[number] == alone.iterations[0]


def test_starts_that_end_in_one_place_are_one(view, room, settings):
    a, b = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
    truth = a.inverse() @ b
    starts = np.concatenate([off(truth, 0.15, 5.0, d) for d in np.linspace(0, 6, 12)])
    poses = refine_point_to_line(view("a", room, a), view("b", room, b), starts, settings).poses
    assert len(poses) == 1


def test_where_nothing_is_near_nothing_moves(view, room, settings):
    target, source = view("a", room, Pose2(2, 1.5, 0.5)), view("b", room, Pose2(3, 2.2, -2.0))
    start = np.array([[200.0, -100.0, 1.0]])
    poses = refine_point_to_line(target, source, start, settings).poses
    np.testing.assert_allclose(poses, start)


@pytest.mark.parametrize(("shared", "answer"), [(2, False), (3, True)])
def test_fewer_than_three_partners_are_no_answer(view, settings, shared, answer):
    """Two walls in one line, of which as many points as given lie within the gate."""
    index = view("a", [((-1.0, 2.0), (1.0, 2.0))], Pose2(0.0, 0.0, 0.2), max_range=3.0)
    along = Pose2(0.0, 0.0, 0.2).inverse().rotation[:, 0]
    for apart in np.arange(1.5, 2.3, 0.005):
        start = np.array([[*(apart * along), 0.0]])
        (partners,) = partner_count(index, index, start, settings.fine_gate_m)
        if partners == shared:
            break
    assert partners == shared
    assert polish(index, index, start, settings).converged.tolist() == [answer]


def test_steps_are_counted(view, room, settings):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    start = np.array([[0.05, 0.02, 0.01]])
    assert polish(index, index, start, settings).iterations.tolist() == [6]
    assert refine_point_to_line(index, index, start, settings).iterations.tolist() == [2 + 6]
    assert 6 < polish(index, index, start, settings, until_still=True).iterations[0] <= 30


def test_no_start_no_pose(view, room, settings):
    index = view("a", room, Pose2(2.0, 1.5, 0.5))
    refined = refine_point_to_line(index, index, np.zeros((0, 3)), settings)
    assert refined.poses.shape == (0, 3)
    assert refined.converged.shape == (0,)


def test_residuals_are_distances_from_the_targets_walls(view, room, settings):
    """Moved 5 cm along x of the plan, points of walls across x are 5 cm off, those along x are not."""
    a = Pose2(2.0, 1.5, 0.0)
    index = view("a", room, a)
    residual, _, weight, _ = correspondences(index, index, np.array([[0.05, 0.0, 0.0]]), gate=0.3)
    corner = np.linalg.norm(a.transform(index.scan.points)[:, None] - room[None, :, 0], axis=2)
    used = (weight[0] > 0) & (corner.min(axis=1) > 0.4)
    across = np.abs(index.scan.normals[used, 0]) > 0.5
    assert min(across.sum(), (~across).sum()) > 50
    np.testing.assert_allclose(np.abs(residual[0, used][across]), 0.05, atol=1e-9)
    np.testing.assert_allclose(residual[0, used][~across], 0.0, atol=1e-9)


def test_jacobian_is_the_derivative_in_the_sources_axes(view, room, settings):
    target, source = view("a", room, Pose2(2, 1.5, 0.5)), view("b", room, Pose2(3, 2.2, -2.0))
    pose = (Pose2(2, 1.5, 0.5).inverse() @ Pose2(3.03, 2.18, -1.97)).vector[None]
    residual, jacobian, weight, partner = correspondences(target, source, pose, gate=0.3)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis][None]
        moved = compose(pose, step)
        other = correspondences(target, source, moved, gate=0.3)
        same = (other.partner == partner) & (weight > 0)
        assert same.sum() > 200
        slope = (other.residual - residual)[same] / 1e-6
        np.testing.assert_allclose(slope, jacobian[same][:, axis], atol=1e-4)


def test_weights_are_metres_of_wall_near_a_reliable_one(view, room, settings):
    target, source = view("a", room, Pose2(2, 1.5, 0.5)), view("b", room, Pose2(3, 2.2, -2.0))
    pose = (Pose2(2, 1.5, 0.5).inverse() @ Pose2(3, 2.2, -2.0)).vector[None]
    rows = correspondences(target, source, pose, gate=0.2)
    weight, partner = rows.weight[0], rows.partner[0]
    used = weight > 0
    np.testing.assert_array_equal(weight[used], source.scan.lengths[used])
    assert target.reliable[partner[used]].all()
    assert used.mean() > 0.8
    far = correspondences(target, source, pose + np.array([[9.0, 0.0, 0.0]]), gate=0.2).weight[0]
    moved = transform(pose + np.array([[9.0, 0.0, 0.0]]), source.scan.points)[0]
    apart = np.linalg.norm(moved[:, None] - target.scan.points[None], axis=2).min(axis=1)
    assert (far[apart > 0.2] == 0.0).all()


@pytest.mark.parametrize("pair", [("s1", "s6"), ("s1", "s7"), ("s2", "s6"), ("s2", "s7")])
def test_refining_loses_no_evidence(three_room_scans, three_room_poses, settings, pair):
    """Lines know nothing of free space: alone, they pull rooms to where 3 to 25 m of wall are looked through."""
    target, source = (three_room_scans[station] for station in pair)
    truth = three_room_poses[pair[0]].inverse() @ three_room_poses[pair[1]]
    rng = np.random.default_rng(6)
    steps = rng.uniform(-1.0, 1.0, (60, 3)) * [0.3, 0.3, 0.1]
    for start in compose(np.tile(truth.vector, (60, 1)), steps):
        refined = refine_point_to_line(target, source, start[None], settings).poses
        before, after = (
            score_matches(target, source, poses, settings).evidence[0]
            for poses in (start[None], refined)
        )
        # 0.3 m may go, and every second or third point does not see all that all see.
        assert after > before - 0.6
