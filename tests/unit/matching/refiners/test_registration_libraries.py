"""What Open3D and KISS-ICP are known to get wrong in silence, through our refiners."""

import math
import subprocess
import sys

import numpy as np
import pytest

from slam_uwb.matching import REFINERS, match_pair
from slam_uwb.matching.covariance import match_covariance
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B


@pytest.fixture(params=["open3d", "kiss_icp"])
def refine(request, need_refiner):
    return REFINERS[need_refiner(request.param)]


@pytest.fixture
def refine_open3d(need_refiner):
    return REFINERS[need_refiner("open3d")]


def off(distance, degrees, direction=0.0):
    step = Pose2(
        distance * math.cos(direction), distance * math.sin(direction), math.radians(degrees)
    )
    return (TRUTH @ step).vector[None]


@pytest.mark.parametrize(
    ("distance", "degrees"), [(0.2, 10.0), (0.2, -10.0), (1.0, 30.0), (1.0, -30.0)]
)
def test_noisy_scans_come_together_from_near_and_far(
    view, room, error, settings, refine, distance, degrees
):
    """Normals estimated by Open3D would point upwards: point to line would leave everything in place."""
    rng = np.random.default_rng(1)
    target, source = view("a", room, A, rng), view("b", room, B, rng)
    starts = [off(distance, degrees, direction) for direction in np.radians(range(0, 360, 45))]
    refined = refine(target, source, np.concatenate(starts), settings)
    assert refined.converged.all()
    # 10 mm of noise, hundreds of points 5 cm apart: point to point ends within 4 mm, to line within 3.
    assert max(error(pose, TRUTH)[:2].max() for pose in refined.poses) < 0.006
    assert max(error(pose, TRUTH)[2] for pose in refined.poses) < math.radians(0.3)


def test_what_one_scan_alone_sees_does_not_pull(view, room, error, settings, refine):
    """A cabinet, 0.25 m deep before a wall, came between the recordings: least squares is 0.1 m off."""
    cabinet = [((1.0, 0.25), (4.5, 0.25)), ((1.0, 0), (1.0, 0.25)), ((4.5, 0), (4.5, 0.25))]
    rng = np.random.default_rng(3)
    target = view("a", room, A, rng)
    source = view("b", np.concatenate([room, cabinet]), B, rng)
    refined = refine(target, source, off(0.2, 10.0, 1.0), settings)
    assert refined.converged.all()
    assert error(refined.poses[0], TRUTH)[:2].max() < 0.01


def test_point_to_line_is_exact_where_scans_are(view, room, error, settings, refine_open3d):
    """Points of two scans are not the same points: without the walls' normals 1.5 mm remain."""
    poses = refine_open3d(view("a", room, A), view("b", room, B), off(0.2, 10.0), settings).poses
    assert error(poses[0], TRUTH).max() < 3e-4


def test_a_corridor_comes_together_across_and_is_known_to_be_free_along(
    view, corridor, settings, refine
):
    rng = np.random.default_rng(5)
    a, b = Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0)
    target, source = (view(s, corridor, p, rng, max_range=15.0) for s, p in (("a", a), ("b", b)))
    start = a.inverse() @ Pose2(b.x, b.y + 0.15, b.theta + 0.05)
    refined = refine(target, source, start.vector[None], settings)
    end = a @ Pose2.from_vector(refined.poses[0])
    assert refined.converged.tolist() == [True]
    assert end.y == pytest.approx(b.y, abs=0.02)
    assert end.angle_to(b) < math.radians(0.5)
    covariance, degenerate = match_covariance(
        target, source, Pose2.from_vector(refined.poses[0]), settings
    )
    assert degenerate
    assert math.sqrt(np.linalg.eigvalsh(covariance).max()) > 0.5


def test_one_wall_is_not_matched_upside_down(view, settings, refine_open3d):
    """Open3D turns a straight wall over, with a fitness of 1: seen from above a mirror image."""
    wall = [((2.0, -0.7), (2.0, 0.7))]
    index = view("a", wall, Pose2.identity(), max_range=2.2)
    poses = refine_open3d(index, index, np.array([[0.1, 0.05, 0.05]]), settings).poses
    # Turned over about the wall, the scanner would be 4 m away and look back.
    assert np.abs(poses[0, [0, 2]]).max() < 0.15


@pytest.mark.parametrize("start", [(200.0, -100.0, 1.0), (-30.0, 0.0, 3.0)])
def test_without_overlap_there_is_no_answer(view, room, settings, refine, start):
    refined = refine(view("a", room, A), view("b", room, B), np.array([start]), settings)
    np.testing.assert_allclose(refined.poses, [start])
    assert refined.converged.tolist() == [False]


def test_every_start_has_its_row(view, room, error, settings, refine):
    starts = np.concatenate([off(0.1, 3.0), [[300.0, 0.0, 0.0], [math.nan] * 3], off(0.1, -3.0)])
    refined = refine(view("a", room, A), view("b", room, B), starts, settings)
    assert refined.converged.tolist() == [True, False, False, True]
    np.testing.assert_array_equal(refined.poses[1:3], starts[1:3])
    assert max(error(refined.poses[k], TRUTH).max() for k in (0, 3)) < 0.03


def test_angles_of_many_turns_do_no_harm(view, room, error, settings, refine):
    """KISS-ICP ends the process where a rotation is not orthonormal."""
    starts = off(0.1, 3.0) + [0.0, 0.0, 2.0 * math.pi * 1000]
    refined = refine(view("a", room, A), view("b", room, B), starts, settings)
    assert refined.converged.all()
    assert error(refined.poses[0], TRUTH).max() < 0.03


def test_a_map_keeps_the_scans_points(view, room, error, settings, need_refiner):
    """With 20 points a voxel, KISS-ICP's default, the map is thinned and matches are worse by half."""
    refine = REFINERS[need_refiner("kiss_icp")]
    rng = np.random.default_rng(1)
    errors = []
    for k in range(24):
        target, source = view("a", room, A, rng), view("b", room, B, rng)
        errors.append(error(refine(target, source, off(0.2, 10.0, k), settings).poses[0], TRUTH))
    assert np.median([np.hypot(x, y) for x, y, _ in errors]) < 0.0026


def test_open3d_has_one_thread_while_it_works(view, room, settings, refine_open3d, monkeypatch):
    """More add up in any order, and the same survey would not give the same bytes."""
    import open3d

    set_to, set_max_threads = [], open3d.utility.set_max_threads
    before = open3d.utility.get_max_threads()
    monkeypatch.setattr(
        open3d.utility, "set_max_threads", lambda n: (set_to.append(n), set_max_threads(n))
    )
    target, source = view("a", room, A), view("b", room, B)
    refine_open3d(target, source, off(0.1, 3.0), settings)
    assert set_to == [1, before]
    monkeypatch.setattr("slam_uwb.matching.refiners.open3d.refine_in_space", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        refine_open3d(target, source, off(0.1, 3.0), settings)
    assert set_to == [1, before] * 2


def test_the_package_does_without_them():
    """They are loaded where they are asked for, and by nothing else."""
    code = "import sys, slam_uwb.matching, slam_uwb.pipeline; print(*{'open3d', 'kiss_icp'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == ""


def test_a_pair_without_common_walls_has_no_hypothesis(view, room, settings, refine, request):
    elsewhere = [((0, 0), (1.2, 0)), ((1.2, 0), (0.6, 1.1)), ((0.6, 1.1), (0, 0))]
    target, source = view("a", room, A), view("b", elsewhere, Pose2(0.6, 0.4, 1.0))
    name = request.node.callspec.params["refine"]
    assert match_pair(target, source, settings.model_copy(update={"refiner": name})) == ()
