import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from slam_uwb.matching import batch
from slam_uwb.model.geometry import Pose2, rotation_matrix, wrap_angle

lengths = st.floats(-50.0, 50.0)
# Ordinary turns, turns at the seam of the angles, and hardly any turn.
angles = st.one_of(
    st.floats(-10.0, 10.0),
    st.floats(-1e-9, 1e-9).map(lambda e: math.pi + e),
    st.floats(-1e-9, 1e-9).map(lambda e: -math.pi + e),
    st.floats(-1e-12, 1e-12),
    st.sampled_from([0.0, math.pi, -math.pi, math.pi / 2]),
)
poses = st.builds(Pose2, lengths, lengths, angles)
points = st.tuples(lengths, lengths).map(np.array)


def matrix(pose):
    """(3, 3) homogeneous matrix, the definition of what a pose does."""
    result = np.eye(3)
    result[:2, :2], result[:2, 2] = rotation_matrix(pose.theta), (pose.x, pose.y)
    return result


def algebra(xi):
    return np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]])


def assert_same(a, b, tolerance=1e-12):
    np.testing.assert_allclose(matrix(a), matrix(b), atol=tolerance * (1 + 50 * 3), rtol=0)


@given(angles)
def test_wrapped_angles_are_the_same_direction_in_half_open_turn(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-12)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-12)


@given(poses, poses)
def test_closure(a, b):
    product = a @ b
    assert -math.pi < product.theta <= math.pi
    np.testing.assert_allclose(matrix(product), matrix(a) @ matrix(b), atol=1e-11)


@given(poses)
def test_identity(a):
    assert a @ Pose2.identity() == a
    assert Pose2.identity() @ a == a


@given(poses)
def test_inverse(a):
    assert_same(a @ a.inverse(), Pose2.identity())
    assert_same(a.inverse() @ a, Pose2.identity())
    assert_same(a.inverse().inverse(), a)


@given(poses, poses)
def test_inverse_of_a_product(a, b):
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(poses, poses, poses)
def test_associativity(a, b, c):
    assert_same((a @ b) @ c, a @ (b @ c))


@given(poses, poses, points)
def test_transforming_by_a_product_is_transforming_twice(a, b, point):
    np.testing.assert_allclose(
        (a @ b).transform(point), a.transform(b.transform(point)), atol=1e-11
    )
    np.testing.assert_allclose(a.inverse().transform(a.transform(point)), point, atol=1e-11)


@given(poses, points, points)
def test_distances_and_handedness_are_kept(a, p, q):
    moved_p, moved_q = a.transform(p), a.transform(q)
    assert np.linalg.norm(moved_p - moved_q) == pytest.approx(np.linalg.norm(p - q), abs=1e-11)
    assert np.linalg.det(a.rotation) == pytest.approx(1.0)


@given(poses, st.tuples(lengths, lengths, st.floats(-3.0, 3.0)).map(np.array))
def test_adjoint_carries_a_motion_to_the_other_side(pose, xi):
    """T Exp(xi) = Exp(Ad_T xi) T for motions of any size, by the matrix exponential."""
    left = matrix(pose) @ expm(algebra(xi))
    right = expm(algebra(pose.adjoint() @ xi)) @ matrix(pose)
    np.testing.assert_allclose(left, right, atol=1e-8)


@given(poses, poses)
def test_adjoint_is_a_homomorphism(a, b):
    np.testing.assert_allclose((a @ b).adjoint(), a.adjoint() @ b.adjoint(), atol=1e-10)
    np.testing.assert_allclose(a.inverse().adjoint() @ a.adjoint(), np.eye(3), atol=1e-10)


@given(poses, poses)
def test_distance_and_angle_do_not_depend_on_the_side(a, b):
    assert a.distance_to(b) == b.distance_to(a)
    assert a.angle_to(b) == pytest.approx(b.angle_to(a), abs=1e-15)
    assert 0.0 <= a.angle_to(b) <= math.pi


@given(st.lists(st.tuples(poses, poses), min_size=1, max_size=4), points)
def test_rows_of_poses_do_what_single_poses_do(pairs, point):
    a, b = (np.array([pose.vector for pose in side]) for side in zip(*pairs, strict=True))
    for index, (one, two) in enumerate(pairs):
        assert_same(Pose2.from_vector(batch.compose(a, b)[index]), one @ two)
        assert_same(Pose2.from_vector(batch.invert(a)[index]), one.inverse())
        np.testing.assert_allclose(batch.adjoints(a)[index], one.adjoint(), atol=1e-12)
        np.testing.assert_allclose(
            batch.transform(a, point[None])[index, 0], one.transform(point), atol=1e-12
        )
