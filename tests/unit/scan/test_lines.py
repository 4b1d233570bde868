import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import distances_to_segments

RECTANGLE = [(0, 0), (5, 0), (5, 4), (0, 4)]
L_ROOM = [(0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)]


def world_segments(walls, pose, observe, settings, **casting):
    segments = prepare_scan("s", observe(walls, pose, **casting), settings).segments
    return pose.transform(segments.reshape(-1, 2)).reshape(-1, 2, 2)


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def assert_each_wall_once(segments, walls, gap):
    """Segments lie on the walls exactly and reach to `gap` of both ends of each."""
    distances = distances_to_segments(segments.reshape(-1, 2), walls)
    wall = distances[::2].argmin(axis=1)
    np.testing.assert_array_equal(np.sort(wall), np.arange(len(walls)))
    assert distances[::2].min(axis=1).max() < 1e-9
    assert distances[1::2].min(axis=1).max() < 1e-9
    short = np.linalg.norm(np.diff(walls, axis=1)[wall, 0], axis=1) - lengths(segments)
    assert short.min() > -1e-9
    assert short.max() < 2 * gap


@pytest.mark.parametrize("theta", [0.0, 0.31, math.pi / 2, -2.2])
@pytest.mark.parametrize("place", [(2.0, 1.5), (1.8, 2.3), (2.5, 2.0)])
def test_a_rectangle_has_four_exact_walls(polygon, observe, settings, theta, place):
    walls = polygon(*RECTANGLE)
    segments = world_segments(walls, Pose2(*place, theta), observe, settings)
    assert_each_wall_once(segments, walls, gap=0.15)


@pytest.mark.parametrize("theta", [0.0, 0.31, math.pi / 2, -2.2])
def test_an_l_shaped_room_has_six_exact_walls(polygon, observe, settings, theta):
    # From here every wall is seen to its ends; none so obliquely that its points fall apart.
    walls = polygon(*L_ROOM)
    segments = world_segments(walls, Pose2(2.6, 2.1, theta), observe, settings)
    assert_each_wall_once(segments, walls, gap=0.2)


def test_ends_that_rays_meet_are_exact(observe, settings):
    # The rays at -30.5 and 20.5 degrees end on the ends of a wall 2 m ahead, along y (no slope there).
    ends = np.array([(2.0, 2.0 * math.tan(math.radians(a))) for a in (-30.5, 20.5)])
    reach = ends + np.array([[0.0, -1e-7], [0.0, 1e-7]])
    segments = world_segments(reach[None], Pose2.identity(), observe, settings)
    np.testing.assert_allclose(segments, ends[None], atol=1e-9)


def test_points_at_corners_turn_no_wall(polygon, observe, settings):
    """Whichever ray passes the corner, its point is given to the wall on which it lies."""
    walls = polygon(*RECTANGLE)
    for theta in np.radians(np.linspace(0.0, 1.0, 23)):
        segments = world_segments(walls, Pose2(2.2, 1.7, theta), observe, settings)
        distances = distances_to_segments(segments.reshape(-1, 2), walls).min(axis=1)
        assert len(segments) == 4
        assert distances.max() < 1e-9


def test_a_room_without_gaps_is_not_cut_at_the_seam(polygon, observe, settings):
    # The scanner's seam, bearing 180 degrees, points at the middle of each wall in turn.
    walls = polygon(*RECTANGLE)
    for quarter in range(4):
        pose = Pose2(2.5, 2.0, quarter * math.pi / 2)
        assert len(world_segments(walls, pose, observe, settings)) == 4


def test_no_wall_is_cut_wherever_the_scanner_stands(polygon, observe, settings):
    """The ring's ends are neighbours: the line through them is as far from all of the wall opposite."""
    walls, rng = polygon(*RECTANGLE), np.random.default_rng(6)
    places = rng.uniform([0.6, 0.6, -3.0], [4.4, 3.4, 3.0], (60, 3))
    for place in [*places, (4.379, 3.097, 1.1284)]:
        assert len(world_segments(walls, Pose2.from_vector(place), observe, settings)) == 4


def test_a_wall_across_the_seam_is_one(observe, settings):
    segments = world_segments([((-2, -1), (-2, 1.5))], Pose2.identity(), observe, settings)
    assert len(segments) == 1
    assert lengths(segments)[0] == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize(("length", "found"), [(0.25, 0), (0.45, 1)])
def test_walls_of_less_than_30_cm_are_clutter(observe, settings, length, found):
    # 1.5 m away the points are 26 mm apart: at least eight, and short by at most two gaps.
    wall = [((1.5, -length / 2), (1.5, length / 2))]
    assert len(world_segments(wall, Pose2.identity(), observe, settings)) == found


def test_a_few_points_are_no_wall(observe, settings):
    # 10 m away the rays at -0.5, 0.5, 1.5, 2.5 degrees ... meet x = 10 at y = -0.09, 0.09, 0.26, 0.44, 0.61.
    for end, found in ((0.3, 0), (0.7, 1)):
        walls = [((10.0, -0.1), (10.0, end)), ((-3.0, 2.0), (-3.0, -2.0))]
        assert len(world_segments(walls, Pose2.identity(), observe, settings)) == found + 1


def test_a_gap_ends_a_wall(observe, settings):
    # A door of 0.9 m in a wall 2 m ahead, nothing behind it.
    walls = [((2, -2), (2, -0.45)), ((2, 0.45), (2, 2))]
    segments = world_segments(walls, Pose2.identity(), observe, settings)
    assert len(segments) == 2
    np.testing.assert_allclose(lengths(segments), 1.55, atol=0.1)


def test_one_lost_sample_does_not_end_a_wall(observe, settings):
    scan = observe([((2, -2), (2, 2))], Pose2.identity())
    ranges = scan.ranges.copy()
    ranges[180] = np.nan
    assert len(prepare_scan("s", replace(scan, ranges=ranges), settings).segments) == 1


def test_steps_higher_than_the_split_distance_part_walls(observe, settings):
    for step, found in ((0.02, 1), (0.2, 2)):
        walls = [((2, -1.5), (2, 0)), ((2 + step, 0), (2 + step, 1.5))]
        assert len(world_segments(walls, Pose2.identity(), observe, settings)) == found


def test_noise_below_the_split_distance_parts_no_wall(polygon, observe, settings):
    walls, rng = polygon(*RECTANGLE), np.random.default_rng(7)
    pose = Pose2(2.2, 1.7, 0.3)
    exact = observe(walls, pose)
    counts = []
    for _ in range(30):
        noisy = replace(exact, ranges=exact.ranges + rng.normal(0.0, 0.01, 360))
        segments = prepare_scan("s", noisy, settings).segments
        counts.append(len(segments))
        ends = pose.transform(segments.reshape(-1, 2))
        assert distances_to_segments(ends, walls).min(axis=1).max() < 0.05
    assert np.mean(np.array(counts) == 4) >= 0.9
