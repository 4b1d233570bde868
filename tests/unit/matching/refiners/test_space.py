import math
from types import SimpleNamespace

import numpy as np
import pytest

from slam_uwb.matching.refiners.space import (
    points_in_space,
    pose_in_plane,
    pose_in_space,
    refine_in_space,
)
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B
NEAR = (TRUTH @ Pose2(0.05, 0.05, 0.02)).vector
# About the x axis by half a turn: a proper rotation that maps a wall along x to itself.
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def pair(view, room):
    return view("a", room, A), view("b", room, B)


def to_truth(_start):
    return pose_in_space(TRUTH.vector)


def stand_still(start):
    return start


def fail(*_):
    raise AssertionError("must not be called")


@pytest.mark.parametrize("theta", [0.0, 1.0, -3.1, 40.0, 1e9])
def test_poses_survive_the_way_into_space_and_back(theta):
    pose = Pose2(1.5, -2.5, theta)
    matrix = pose_in_space(np.array([1.5, -2.5, theta]))
    # What KISS-ICP wants, or it ends the process: orthonormal to 1e-5 (single precision).
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-14)
    points = np.random.default_rng(0).uniform(-5.0, 5.0, (9, 2))
    moved = points_in_space(points) @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(moved, points_in_space(pose.transform(points)), atol=1e-6)
    np.testing.assert_allclose(pose_in_plane(matrix), pose.vector, atol=1e-7)


@pytest.mark.parametrize("spoil", [((2, 3), 0.01), ((0, 3), math.nan), ((1, 1), math.inf)])
def test_motions_out_of_the_plane_and_nan_are_no_poses(spoil):
    place, value = spoil
    matrix = pose_in_space(NEAR)
    matrix[place] = value
    assert pose_in_plane(matrix) is None
    assert pose_in_plane(UPSIDE_DOWN) is None


def test_a_pose_that_brings_the_walls_together_is_an_answer(pair, settings):
    refined = refine_in_space(*pair, NEAR[None], settings, lambda: (stand_still, to_truth))
    assert refined.converged.tolist() == [True]
    np.testing.assert_allclose(refined.poses[0], TRUTH.vector, atol=1e-12)


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_the_start_given_back_is_no_answer(pair, settings, turns):
    """However well it fits, and however the library writes its angle."""
    start = NEAR + [0.0, 0.0, 2.0 * math.pi * turns]
    refined = refine_in_space(*pair, start[None], settings, lambda: (stand_still,))
    assert refined.converged.tolist() == [False]


def test_a_pose_without_partners_is_no_answer(pair, settings):
    def away(_start):
        return pose_in_space(np.array([50.0, 0.0, 0.0]))

    assert not refine_in_space(*pair, NEAR[None], settings, lambda: (away,)).converged.any()


def test_back_to_back_walls_are_no_partners(view, settings):
    """One wall 0.1 m thick seen from either side: all points are within the gate, none on one face."""
    front = view("a", [((-3, 0.0), (3, 0.0))], Pose2(0.0, -1.5, 0.3), max_range=5.0)
    back = view("b", [((-3, 0.1), (3, 0.1))], Pose2(0.0, 1.5, -0.4), max_range=5.0)
    truth = Pose2(0.0, -1.5, 0.3).inverse() @ Pose2(0.0, 1.5, -0.4)

    def glue(_start):
        return pose_in_space((Pose2(0.0, -1.5, 0.3).inverse() @ Pose2(0.0, 1.4, -0.4)).vector)

    assert not refine_in_space(
        front, back, truth.vector[None], settings, lambda: (glue,)
    ).converged.any()


def test_no_stage_follows_one_that_left_the_plane(pair, settings):
    def turn_over(_start):
        return UPSIDE_DOWN

    refined = refine_in_space(*pair, NEAR[None], settings, lambda: (turn_over, fail))
    np.testing.assert_array_equal(refined.poses[0], NEAR)
    assert refined.converged.tolist() == [False]


def test_starts_that_are_no_numbers_do_not_reach_the_library(pair, settings):
    starts = np.stack([NEAR, [math.nan, 0.0, 0.0], NEAR, [0.0, 0.0, math.inf]])
    refined = refine_in_space(*pair, starts, settings, lambda: (to_truth,))
    assert refined.converged.tolist() == [True, False, True, False]
    np.testing.assert_array_equal(refined.poses[[1, 3]], starts[[1, 3]])
    assert not refine_in_space(*pair, starts[[1]], settings, lambda: (fail,)).converged.any()


@pytest.mark.parametrize("spoilt", [0, 1])
@pytest.mark.parametrize("kind", ["empty", "NaN"])
def test_scans_that_are_no_scans_do_not_reach_the_library(pair, settings, spoilt, kind):
    points = np.zeros((0, 2)) if kind == "empty" else pair[spoilt].scan.points.copy()
    points[7:8, 1] = math.nan
    scans = list(pair)
    scans[spoilt] = SimpleNamespace(scan=SimpleNamespace(points=points))
    refined = refine_in_space(*scans, NEAR[None], settings, fail)
    assert refined.converged.tolist() == [False]
    np.testing.assert_array_equal(refined.poses[0], NEAR)


def test_no_start_no_pose(pair, settings):
    refined = refine_in_space(*pair, np.zeros((0, 3)), settings, lambda: (fail,))
    assert refined.poses.shape == (0, 3)
    assert refined.converged.shape == (0,)
