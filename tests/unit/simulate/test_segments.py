import numpy as np
import pytest

from slam_uwb.simulate.segments import (
    cast_rays,
    clear_paths,
    crossing_fractions,
    distances_to_segments,
)

BOX = np.array([[[0, 0], [4, 0]], [[4, 0], [4, 2]], [[4, 2], [0, 2]], [[0, 2], [0, 0]]], float)


def all_pairs(origin, bearings, segments):
    """Solve origin + r u = a + s (b - a) for every ray and segment."""
    rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)[:, None]
    a, along = segments[None, :, 0] - origin, (segments[:, 1] - segments[:, 0])[None]
    det = rays[..., 0] * along[..., 1] - rays[..., 1] * along[..., 0]
    r = (a[..., 0] * along[..., 1] - a[..., 1] * along[..., 0]) / det
    s = (a[..., 0] * rays[..., 1] - a[..., 1] * rays[..., 0]) / det
    return np.where((r > 0) & (s >= 0) & (s <= 1), r, np.inf).min(axis=1)


def test_ranges_in_a_box_are_those_of_the_closed_form():
    # From (1, 1) in a 4 x 2 box: 3 m east, 1 m north, west and south, sqrt(2) to both western corners.
    bearings = np.deg2rad([0, 90, 180, -90, 135, 225, 360])
    expected = [3, 1, 1, 1, np.sqrt(2), np.sqrt(2), 3]
    np.testing.assert_allclose(cast_rays(np.array([1.0, 1.0]), bearings, BOX), expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_sliced_casting_equals_all_pairs(seed):
    rng = np.random.default_rng(seed)
    segments = rng.uniform(-5, 5, (80, 2, 2))
    bearings = rng.uniform(-7, 7, 700)
    origin = rng.uniform(-1, 1, 2)
    np.testing.assert_allclose(
        cast_rays(origin, bearings, segments), all_pairs(origin, bearings, segments), rtol=1e-9
    )


def test_nothing_slips_between_two_walls_at_their_corner():
    rng = np.random.default_rng(0)
    for origin in rng.uniform([0.1, 0.1], [3.9, 1.9], (200, 2)):
        corners = BOX[:, 0] - origin
        ranges = cast_rays(origin, np.arctan2(corners[:, 1], corners[:, 0]), BOX)
        np.testing.assert_allclose(ranges, np.linalg.norm(corners, axis=1), rtol=1e-9)


def test_rays_out_of_an_open_side_meet_nothing():
    assert np.isinf(cast_rays(np.array([1.0, 1.0]), np.array([0.0]), BOX[[0, 2, 3]])).all()


def test_crossings_say_where_on_the_path():
    wall = np.array([[[1, -1], [1, 1]]], float)
    starts, ends = np.array([[0.0, 0.0], [0.0, 0.0]]), np.array([[4.0, 0.0], [0.5, 0.0]])
    np.testing.assert_array_equal(crossing_fractions(starts, ends, wall), [[0.25], [np.nan]])
    np.testing.assert_array_equal(clear_paths(starts, ends, wall), [False, True])


def test_distance_is_to_the_segment_and_not_to_its_line():
    wall = np.array([[[0, 0], [2, 0]]], float)
    points = np.array([[1.0, 0.5], [5.0, 4.0], [-1.0, 0.0]])
    np.testing.assert_allclose(distances_to_segments(points, wall)[:, 0], [0.5, 5.0, 1.0])
