import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.index import index_scan
from slam_uwb.model.geometry import Pose2, rotation_matrix
from slam_uwb.model.settings import MatchingSettings

CELL = 0.1


def free_ranges(index, points):
    """Metres looked through towards `points` (..., 2) in the scanner's frame."""
    turned = points @ rotation_matrix(index.table_turn)
    return index.free_range(turned[..., 0], turned[..., 1])


def nearest(index, points):
    """Number of the scan's point nearest to each of `points` (..., 2) in the scanner's frame."""
    turned = points @ rotation_matrix(index.table_turn)
    return index.nearest_in_table(turned[..., 0], turned[..., 1])


def brute_distances(scan, points):
    return np.linalg.norm(points[:, None] - scan.points[None], axis=2).min(axis=1)


def test_nearest_by_table_is_nearest_but_for_the_cells(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    queries = np.random.default_rng(0).uniform(-4.0, 4.0, (5000, 2))
    found = np.linalg.norm(queries - index.scan.points[nearest(index, queries)], axis=1)
    excess = found - brute_distances(index.scan, queries)
    # Query and both points lie up to half a diagonal off their cells' centres: four half diagonals at worst.
    assert excess.min() > -1e-12
    assert excess.max() < 2.0 * math.sqrt(2.0) * CELL
    assert excess.mean() < 0.02


def test_a_scans_own_points_find_themselves_or_a_neighbour(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    points = index.scan.points
    found = np.linalg.norm(points - points[nearest(index, points)], axis=1)
    assert found.max() < math.sqrt(2.0) * CELL


def test_look_ups_keep_the_shape_of_the_points(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    points = np.random.default_rng(1).uniform(-3.0, 3.0, (4, 7, 2))
    found, free = nearest(index, points), free_ranges(index, points)
    assert found.shape == free.shape == (4, 7)
    assert found[2, 3] == nearest(index, points[2, 3][None])[0]
    assert free[2, 3] == free_ranges(index, points[2, 3][None])[0]


def test_points_outside_the_table_have_a_nearest_one_too(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.0))
    far = np.array([[500.0, 0.1], [-500.0, 0.1], [0.1, 500.0], [0.1, -500.0]])
    found = index.scan.points[nearest(index, far)]
    # Walls at x - 2 = 4 and -2, y - 1.5 = 3 (the deeper part of the room) and -1.5.
    np.testing.assert_allclose(
        [found[0, 0], found[1, 0], found[2, 1], found[3, 1]], [4.0, -2.0, 3.0, -1.5], atol=0.1
    )


def test_walls_far_away_do_not_make_the_table_large(view):
    wall = [((900.0, -900.0), (900.0, 900.0)), ((2.0, -1.0), (2.0, 1.0))]
    index = view("a", wall, Pose2.identity(), max_range=2000.0)
    assert index.table.size < 500_000


def test_free_range_is_that_of_the_sector(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    sectors = np.radians(np.arange(-180, 180) + 0.5)
    for shift in (-0.49, 0.0, 0.49):
        bearings = sectors + math.radians(shift)
        for distance in (0.01, 20.0):
            points = distance * np.column_stack([np.cos(bearings), np.sin(bearings)])
            np.testing.assert_array_equal(free_ranges(index, points), index.scan.free_ranges)


def test_sectors_meet_at_the_seam_of_the_bearings(view, room):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    above, below = free_ranges(index, np.array([[-1.0, 1e-6], [-1.0, -1e-6]]))
    assert (above, below) == (index.scan.free_ranges[-1], index.scan.free_ranges[0])


@pytest.mark.parametrize("turn", [0.3, 1.7, -2.5])
def test_look_ups_do_not_depend_on_how_the_scanner_was_turned(view, room, turn):
    """In its own axes the table is the same, cell by cell, and so is what is looked up in it."""
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    back = Pose2(0.0, 0.0, -turn)
    turned = index_scan(
        replace(
            index.scan,
            points=back.transform(index.scan.points),
            normals=back.transform(index.scan.normals),
        ),
        MatchingSettings(),
    )
    assert math.isclose(
        math.remainder(turned.turn - index.turn + turn, 2 * math.pi), 0.0, abs_tol=1e-9
    )
    np.testing.assert_allclose(turned.table_columns, index.table_columns, atol=1e-9)
    points = np.random.default_rng(3).uniform(-4.0, 4.0, (500, 2))
    np.testing.assert_array_equal(nearest(turned, back.transform(points)), nearest(index, points))


def test_only_normals_of_straight_walls_are_reliable(view, room, settings):
    index = view("a", room, Pose2(2.0, 1.5, 0.4))
    world = Pose2(2.0, 1.5, 0.4).transform(index.scan.points)
    corner = np.linalg.norm(world[:, None] - room[None, :, 0], axis=2).min(axis=1)
    # Where a wall is seen so flatly that a point has no neighbours, it has no normal either.
    assert index.reliable[corner > 0.5].mean() > 0.9
    lonely = replace(index.scan, normal_variance=np.full(len(corner), np.inf))
    assert not index_scan(lonely, settings).reliable.any()
