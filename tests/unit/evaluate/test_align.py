"""Rigid alignment: known answers, invariance, never a reflection."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slam_uwb.evaluate import rigid_alignment
from slam_uwb.model.geometry import Pose2, rotation_matrix

PLACE = st.floats(-50.0, 50.0)
POSES = st.builds(Pose2, PLACE, PLACE, st.floats(-math.pi, math.pi))
POINTS = st.lists(st.tuples(PLACE, PLACE), min_size=3, max_size=8).map(np.array)


def cost(pose, source, target):
    return float(np.sum((pose.transform(source) - target) ** 2))


def close(a, b, tolerance=1e-9):
    return a.distance_to(b) < tolerance and a.angle_to(b) < tolerance


def test_a_quarter_turn_by_hand():
    # (0, 0) -> (1, 1) and (2, 0) -> (1, 3): x became y, so a turn of 90 degrees, then a shift of (1, 1).
    pose = rigid_alignment([(0.0, 0.0), (2.0, 0.0)], [(1.0, 1.0), (1.0, 3.0)])
    assert close(pose, Pose2(1.0, 1.0, math.pi / 2))


def test_scale_is_not_taken_out():
    # Stretched by a tenth about its centre: the best rigid motion leaves it where it is.
    square = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    assert close(rigid_alignment(square, 1.1 * square), Pose2.identity())


def test_one_displaced_point_by_hand():
    # Square of corners (+-1, +-1); the corner (1, 1) goes to (1, 3). Shift: (0, 2) / 4 = (0, 0.5). Turn about the
    # centre: sums of a x b and a . b over the corners, with b = a + d, d the displacement less its mean:
    # a x d = 1 * 2 = 2 for that corner (the mean adds nothing, since the a sum to zero), a . a = 8, a . d = 2:
    # theta = atan2(2, 10).
    square = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    target = square + np.array([(0.0, 2.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)])
    assert close(rigid_alignment(square, target), Pose2(0.0, 0.5, math.atan2(2.0, 10.0)))


@given(POINTS, POSES)
def test_a_rigid_motion_is_found_exactly(points, pose):
    assume(np.ptp(points, axis=0).max() > 1e-2)
    assert close(rigid_alignment(points, pose.transform(points)), pose, 1e-6)


@given(POINTS, st.integers(0, 2**32 - 1), POSES, POSES)
def test_what_remains_does_not_depend_on_the_frames(points, seed, one, other):
    assume(np.ptp(points, axis=0).max() > 1e-2)
    target = points + np.random.default_rng(seed).normal(0.0, 1e-3, points.shape)
    plain = rigid_alignment(points, target).transform(points) - target
    moved = rigid_alignment(one.transform(points), other.transform(target))
    remaining = moved.transform(one.transform(points)) - other.transform(target)
    np.testing.assert_allclose(
        np.linalg.norm(remaining, axis=1), np.linalg.norm(plain, axis=1), atol=1e-9
    )


@given(POINTS, st.integers(0, 2**32 - 1), POSES)
def test_no_other_motion_is_better(points, seed, step):
    assume(np.ptp(points, axis=0).max() > 1e-2)
    target = np.random.default_rng(seed).normal(0.0, 10.0, points.shape)
    best = rigid_alignment(points, target)
    small = Pose2(step.x / 100, step.y / 100, step.theta / 100)
    found = cost(best, points, target)
    for other in (step @ best, small @ best, best @ small):
        assert found <= cost(other, points, target) * (1 + 1e-12) + 1e-9


def test_a_mirror_image_is_not_undone():
    # A scalene triangle and its image in the x axis: only a reflection would bring them together.
    triangle = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)])
    image = triangle * (1.0, -1.0)
    pose = rigid_alignment(triangle, image)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    # No rotation about the centres does better, looked for every tenth of a degree.
    a, b = triangle - triangle.mean(axis=0), image - image.mean(axis=0)
    costs = [
        np.sum((a @ rotation_matrix(t).T - b) ** 2) for t in np.radians(np.arange(0, 360, 0.1))
    ]
    assert 1.0 < cost(pose, triangle, image) <= min(costs) + 1e-9


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ([(0.0, 0.0)], [(1.0, 1.0)]),
        (np.zeros((0, 2)), np.zeros((0, 2))),
        ([(1.0, 2.0), (1.0, 2.0)], [(0.0, 0.0), (1.0, 0.0)]),
        ([(0.0, 0.0), (1.0, 0.0)], [(0.0, 0.0), (math.nan, 0.0)]),
        ([(0.0, 0.0), (1.0, 0.0)], [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]),
        ([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]),
        # A square and its mirror image: every rotation is as bad as every other.
        ([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)], [(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)]),
    ],
)  # fmt: skip
def test_what_cannot_be_aligned_is_refused(source, target):
    with pytest.raises(ValueError, match=r"shape|at least two|undetermined"):
        rigid_alignment(source, target)
