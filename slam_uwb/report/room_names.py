"""Where in a room its name is written: clear of the walls and of what else stands there."""

from __future__ import annotations

import numpy as np

from ..model.geometry import Points, Vector2

_CELLS_A_SIDE = 48
_FLATNESS = 3.0
"""A line of text is that much wider than high, so what lies beside it must be farther off."""

_CENTRAL = 0.05
"""Space that a place gives up for lying nearer to the middle: long rooms have much of the same."""


def roomiest_place(polygon: Points, others: Points) -> Vector2:
    """Of a raster of places inside a room the one with the most space round it.

    Args:
        polygon: (N, 2) m, corners in turn.
        others: (M, 2) m, what else is drawn.

    Returns:
        (2,) m. Inside the room, which the mean of the corners need not be.
    """
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    steps = (np.arange(_CELLS_A_SIDE) + 0.5) / _CELLS_A_SIDE
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * (high - low) + low
    places = places[_inside(places, polygon)]
    if not len(places):
        return np.asarray(polygon.mean(axis=0))
    flat = np.array([1.0 / _FLATNESS, 1.0])
    space = _to_sides(places * flat, polygon * flat)
    if len(others):
        apart = np.linalg.norm((places[:, None] - others[None]) * flat, axis=2)
        space = np.minimum(space, apart.min(axis=1))
    off_centre = np.linalg.norm(places - places.mean(axis=0), axis=1)
    return np.asarray(places[int(np.argmax(space - _CENTRAL * off_centre))])


def _inside(places: Points, polygon: Points) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(P,) whether a ray along x crosses an odd number of sides."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = places[:, :1], places[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return np.asarray((spans & (crossing > x)).sum(axis=1) % 2 == 1)


def _to_sides(places: Points, polygon: Points) -> Points:
    """(P,) distance to the nearest side."""
    a, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    offset = places[:, None] - a
    share = np.clip((offset * along).sum(axis=2) / squared, 0.0, 1.0)
    distances = np.linalg.norm(offset - share[..., None] * along, axis=2)
    return np.asarray(distances.min(axis=1))
