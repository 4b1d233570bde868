"""What a tripod would see from a place in the known map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..model.floor import OCCUPIED_ABOVE, FloorMap
from ..model.geometry import FloatArray, Points

_RAYS = 90
_MOST_PLACES = 2000
"""More are thinned evenly: time and memory."""


def free_places(floor_map: FloorMap, spacing: float, clearance: float) -> Points:
    """(N, 2) m, a grid of places in the known free space, at least `clearance` m from anything else."""
    if not floor_map.occupancy.size:
        return np.empty((0, 2))
    free = floor_map.free
    # Padded, since the map's border is unknown too.
    room = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * floor_map.resolution
    step = max(1, round(spacing / floor_map.resolution))
    chosen = np.zeros_like(free)
    chosen[step // 2 :: step, step // 2 :: step] = True
    rows, columns = np.nonzero(chosen & (room >= clearance))
    thin = -(-len(rows) // _MOST_PLACES) if len(rows) else 1
    rows, columns = rows[::thin], columns[::thin]
    cells = np.column_stack([columns, rows]) + 0.5
    return np.asarray(np.array(floor_map.origin) + cells * floor_map.resolution)


def known_view(floor_map: FloorMap, places: Points, reach: float) -> FloatArray:
    """(N,) share of the directions in which a scan from each place ends at a wall of the map within `reach` m.

    Such a scan overlaps what other stations saw; one that ends in the unknown does not.
    """
    bearings = 2.0 * math.pi * np.arange(_RAYS) / _RAYS
    step = floor_map.resolution * np.column_stack([np.cos(bearings), np.sin(bearings)])
    ended = np.zeros(len(places) * _RAYS, dtype=np.bool_)
    # Only the rays that still go on are followed: most end long before `reach`.
    ray = np.arange(len(ended))
    at = np.repeat(places, _RAYS, axis=0)
    for _ in range(int(reach / floor_map.resolution)):
        at = at + step[ray % _RAYS]
        wall, known = _cells_at(floor_map, at)
        ended[ray[wall]] = True
        ray, at = ray[known & ~wall], at[known & ~wall]
    return np.asarray(ended.reshape(-1, _RAYS).mean(axis=1))


def _cells_at(floor_map: FloorMap, places: Points) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) whether the cells at (N, 2) m are occupied, and whether they were seen; beyond the map neither."""
    cells = np.floor((places - np.array(floor_map.origin)) / floor_map.resolution).astype(np.int64)
    height, width = floor_map.occupancy.shape
    inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < [width, height]), axis=1)
    column, row = np.where(inside[:, None], cells, 0).T
    value = floor_map.occupancy[row, column]
    return inside & (value > OCCUPIED_ABOVE), inside & ~np.isnan(value)


def walls_between(ends: FloatArray, starts: Points, targets: Points) -> NDArray[np.int64]:
    """(N, M) number of walls (W, 2, 2) that the straight paths from starts (N, 2) to targets (M, 2) cross."""
    counts = np.zeros((len(starts), len(targets)), dtype=np.int64)
    p, a, b = starts[:, None], ends[None, :, 0], ends[None, :, 1]
    # Target by target: a building has thousands of walls, and memory goes with the product.
    for column, target in enumerate(targets):
        q = target[None, None, :]
        apart = (_side(p, q, a) * _side(p, q, b) < 0.0) & (_side(a, b, p) * _side(a, b, q) < 0.0)
        counts[:, column] = apart.sum(axis=1)
    return counts


def _side(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
    """Positive where r lies on the left of the way from p to q."""
    return np.asarray(
        (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
        - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
    )
