from __future__ import annotations

import math

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import WallPieces
from slam_uwb.ranging.crossings import count_walls

NO_WALLS = WallPieces(np.zeros((0, 2, 2)), np.zeros(0, np.int32), np.zeros(0))


def walls(*pieces, lines=None, probability=1.0) -> WallPieces:
    count = len(pieces)
    lines = range(count) if lines is None else lines
    return WallPieces(
        np.array(pieces, dtype=float), np.array(list(lines)), np.full(count, probability)
    )


def count(pieces, tag, place):
    return count_walls(pieces, np.array(tag, dtype=float), np.array(place, dtype=float))


WALL = [(3.0, -5.0), (3.0, 5.0)]


@pytest.mark.parametrize(
    ("place", "crossed"), [((6.0, 1.0), 1), ((2.0, 1.0), 0), ((-4.0, 0.0), 0), ((6.0, 30.0), 0)]
)
def test_a_wall_is_crossed_or_not(place, crossed):
    counts = count(walls(WALL), (0.0, 0.0), place)

    assert counts[crossed] == pytest.approx(1.0, abs=1e-6)
    assert counts.sum() == pytest.approx(1.0)


def test_independent_walls_are_poisson_binomial():
    pieces = WallPieces(
        np.array([WALL, [(5.0, -5.0), (5.0, 5.0)]]), np.array([0, 1]), np.array([0.9, 0.2])
    )

    counts = count(pieces, (0.0, 0.0), (8.0, 0.0))

    # 0.1 * 0.8, 0.9 * 0.8 + 0.1 * 0.2, 0.9 * 0.2.
    np.testing.assert_allclose(counts, [0.08, 0.74, 0.18, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(("thickness", "crossed"), [(0.12, 1), (0.28, 1), (0.5, 2)])
def test_two_faces_of_one_wall_are_one_wall_however_oblique_the_path(thickness, crossed):
    far = [(3.0 + thickness, -9.0), (3.0 + thickness, 9.0)]

    # At 60 degrees to the normal the crossings are twice the thickness apart along the path.
    counts = count(walls([(3.0, -9.0), (3.0, 9.0)], far), (0.0, 0.0), (5.0, 5.0 * math.sqrt(3.0)))

    assert counts[crossed] == pytest.approx(1.0, abs=1e-3)


def test_the_surer_face_speaks_for_the_wall():
    pieces = WallPieces(
        np.array([WALL, [(3.1, -5.0), (3.1, 5.0)]]), np.array([0, 1]), np.array([0.3, 0.8])
    )

    assert count(pieces, (0.0, 0.0), (8.0, 0.0))[1] == pytest.approx(0.8)


def test_pieces_of_one_line_that_touch_are_one_wall():
    # The path runs through the very end that both pieces share.
    pieces = walls([(3.0, -5.0), (3.0, 0.0)], [(3.0, 0.0), (3.0, 5.0)], lines=[0, 0])

    assert count(pieces, (0.0, 0.0), (8.0, 0.0))[1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("tag_x", "in_front", "behind"), [(0.0, 2.95, 3.21), (6.0, 3.21, 2.95)])
def test_an_anchor_on_a_face_is_on_the_side_of_the_walls_middle(tag_x, in_front, behind):
    # Seen from x < 3 the wall's middle is 0.08 m behind the face. 0.13 m from it are 1.625 sigmas: 5.2 %.
    free, blocked, middle = (
        count(walls(WALL), (tag_x, 0.0), (x, 1.0))[1] for x in (in_front, behind, 3.08)
    )

    assert free == pytest.approx(0.052, abs=1e-3)
    assert blocked == pytest.approx(0.948, abs=1e-3)
    assert middle == pytest.approx(0.5, abs=1e-6)


def test_labels_are_smooth_in_the_place():
    # A millimetre changes no label by more than a few percent, at the wall and at its end.
    places = np.column_stack([np.arange(2.7, 3.3, 1e-3), np.full(600, 4.9)])
    places = np.vstack([places, np.column_stack([np.full(600, 3.2), np.arange(4.7, 5.3, 1e-3)])])
    counts = count_walls(walls(WALL), np.zeros(2), places)

    steps = np.abs(np.diff(counts, axis=0)).max(axis=1)
    assert np.delete(steps, 599).max() < 0.02


def test_turning_everything_changes_nothing():
    rng = np.random.default_rng(0)
    ends = rng.uniform(-5, 5, (30, 2, 2))
    tags, places = rng.uniform(-5, 5, (2, 50, 2))
    pieces = WallPieces(ends, np.arange(30), rng.random(30))
    move = Pose2(20.0, -7.0, 2.0)
    moved = WallPieces(
        move.transform(ends.reshape(-1, 2)).reshape(-1, 2, 2), np.arange(30), pieces.probability
    )

    np.testing.assert_allclose(
        count_walls(moved, move.transform(tags), move.transform(places)),
        count_walls(pieces, tags, places),
        atol=1e-9,
    )


def test_a_path_alone_crosses_what_it_crosses_among_paths_all_over_the_building():
    # Alone only the walls around it are looked at: none that it crosses or grazes may be missing.
    rng = np.random.default_rng(1)
    first = rng.uniform(-20, 20, (300, 2))
    ends = np.stack([first, first + rng.normal(0.0, 3.0, (300, 2))], axis=1)
    pieces = WallPieces(ends, np.arange(300), rng.random(300))
    tags = rng.uniform(-20, 20, (200, 2))
    places = tags + rng.normal(0.0, 0.7, (200, 2))

    alone = [count_walls(pieces, tag, place) for tag, place in zip(tags, places, strict=True)]

    np.testing.assert_allclose(count_walls(pieces, tags, places), alone, atol=1e-12)


def test_more_walls_than_are_told_apart_are_counted_in_the_last_place():
    many = [[(x, -5.0), (x, 5.0)] for x in range(1, 9)]

    np.testing.assert_allclose(count(walls(*many), (0.0, 0.0), (9.0, 0.0)), [0, 0, 0, 0, 1])


def test_without_walls_nothing_is_crossed():
    counts = count_walls(NO_WALLS, np.zeros(2), np.ones((3, 4, 2)))

    assert counts.shape == (3, 4, 5)
    assert (counts[..., 0] == 1.0).all()
