import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from slam_uwb.matching.refiners.paper_lm import refine_paper_lm
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B


def off(distance, degrees, direction=0.0):
    step = Pose2(
        distance * math.cos(direction), distance * math.sin(direction), math.radians(degrees)
    )
    return (TRUTH @ step).vector[None]


@pytest.mark.parametrize("direction", np.radians([0, 120, 240]))
@pytest.mark.parametrize("degrees", [10.0, -10.0])
def test_exact_scans_come_within_the_gaps_between_points(
    view, room, error, settings, direction, degrees
):
    refined = refine_paper_lm(
        view("a", room, A), view("b", room, B), off(0.2, degrees, direction), settings
    )
    assert refined.converged.tolist() == [True]
    # The points of two scans are not the same points: point to point errs by a share of their gaps.
    assert error(refined.poses[0], TRUTH)[:2].max() < 0.03
    assert error(refined.poses[0], TRUTH)[2] < math.radians(1.0)


def test_a_scan_comes_back_to_itself_exactly(view, room, settings):
    index = view("a", room, A)
    start = np.array([[0.02, -0.015, 0.005]])
    refined = refine_paper_lm(index, index, start, settings)
    assert refined.converged.all()
    np.testing.assert_allclose(refined.poses, 0.0, atol=1e-9)


def test_the_end_is_a_minimum_of_the_papers_sum(view, room, settings):
    """Algorithm 4, lines 4-5: squared distances to the closest points, of the points kept at the start."""
    target, source, start = view("a", room, A), view("b", room, B), off(0.1, 4.0)
    tree = cKDTree(target.scan.points)
    moved = Pose2.from_vector(start[0]).transform(source.scan.points)
    kept = source.scan.points[tree.query(moved)[0] < settings.closest_point_m]
    assert 0.5 < len(kept) / len(moved) <= 1.0

    def cost(pose):
        return (tree.query(pose.transform(kept))[0] ** 2).sum()

    end = Pose2.from_vector(refine_paper_lm(target, source, start, settings).poses[0])
    for step in np.concatenate([np.eye(3), -np.eye(3)]) * [1e-3, 1e-3, 5e-4]:
        assert cost(end) <= cost(end @ Pose2.from_vector(step))


def test_every_start_has_its_row(view, room, error, settings):
    starts = np.concatenate([off(0.1, 3.0), [[300.0, 0.0, 0.0]], off(0.1, -3.0)])
    refined = refine_paper_lm(view("a", room, A), view("b", room, B), starts, settings)
    assert refined.converged.tolist() == [True, False, True]
    np.testing.assert_array_equal(refined.poses[1], starts[1])
    assert max(error(refined.poses[k], TRUTH).max() for k in (0, 2)) < 0.03


def test_no_start_no_pose(view, room, settings):
    index = view("a", room, A)
    refined = refine_paper_lm(index, index, np.zeros((0, 3)), settings)
    assert refined.poses.shape == (0, 3)
    assert refined.converged.shape == (0,)
