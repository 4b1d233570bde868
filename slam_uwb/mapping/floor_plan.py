"""Pieces of wall -> walls with their thickness, doors, and rooms: a floor plan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.floor import FloorMap, FloorPlan, Wall
from ..model.geometry import FloatArray, Points
from ..model.products import WallPieces
from ..model.settings import MappingSettings
from .rooms import directions, door_gaps, find_rooms, places_along

_OPPOSITE = math.cos(math.radians(175.0))
_THICKNESS_M = (0.04, 0.45)
"""Between the two faces of one wall."""
_LEAST_COMMON_M = 0.1
_TOUCHING_M = 0.02
_DOOR_M = 0.5
"""Narrower gaps are the ends of walls that meet there."""
_SAME_DOOR_M = 0.5


def build_floor_plan(
    pieces: WallPieces, floor_map: FloorMap, settings: MappingSettings
) -> FloorPlan:
    """Walls merged over their faces, doors as gaps in them, rooms as closed polygons.

    Args:
        pieces: walls and furniture, world frame (`find_walls`).
        floor_map: what was looked through.
        settings: `room_...` and `wall_...`.
    """
    chosen = pieces.probability >= settings.room_wall_probability
    line, ends = pieces.line[chosen], pieces.ends[chosen]
    joined, number, probability = _joined(line, ends, pieces.probability[chosen])
    return FloorPlan(
        rooms=find_rooms(pieces, floor_map, settings),
        walls=_walls(joined, probability),
        doors=_doors(number, joined, settings.wall_chain_gap_m),
    )


def _joined(
    line: NDArray[np.int32], ends: FloatArray, probability: FloatArray
) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """Stretches (S, 2, 2) m of touching pieces, their lines (S,), and the mean probability by length (S,)."""
    if not len(ends):
        return ends, line, probability
    places = places_along(line, ends)
    order = np.lexsort((places[:, 0], line))
    line, ends, places = line[order], ends[order], places[order]
    probability = probability[order]
    apart = (line[1:] != line[:-1]) | (places[1:, 0] - places[:-1, 1] > _TOUCHING_M)
    first = np.concatenate([[0], np.flatnonzero(apart) + 1])
    last = np.concatenate([first[1:], [len(line)]]) - 1
    lengths = np.maximum(places[:, 1] - places[:, 0], 1e-9)
    mean = np.add.reduceat(probability * lengths, first) / np.add.reduceat(lengths, first)
    return np.stack([ends[first, 0], ends[last, 1]], axis=1), line[first], mean


def _walls(ends: FloatArray, probability: FloatArray) -> tuple[Wall, ...]:
    """Centre lines where two faces look away from each other, and what is left of the faces."""
    way = directions(ends)
    walls, rest = (
        [],
        [[(0.0, float(length))] for length in np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)],
    )
    for i, j, depth, low, high in _face_pairs(ends, way):
        for part_low, part_high in _common(rest[i], (low, high)):
            middle = ends[i, 0] - 0.5 * depth * _left(way[i])
            span = np.array([[part_low], [part_high]]) * way[i]
            walls.append(Wall(middle + span, depth, float(max(probability[i], probability[j]))))
        rest[i] = _without(rest[i], (low, high))
        other = np.sort((ends[i, 0] + np.array([[low], [high]]) * way[i] - ends[j, 0]) @ way[j])
        rest[j] = _without(rest[j], (float(other[0]), float(other[1])))
    for k, spans in enumerate(rest):
        for low, high in spans:
            if high - low >= _LEAST_COMMON_M:
                face = ends[k, 0] + np.array([[low], [high]]) * way[k]
                walls.append(Wall(face, math.nan, float(probability[k])))
    return tuple(walls)


def _face_pairs(ends: FloatArray, way: Points) -> list[tuple[int, int, float, float, float]]:
    """Faces i and j of one wall, m between them, and where they overlap (m from i's first end), thinnest first."""
    facing = way @ way.T < _OPPOSITE
    i, j = np.nonzero(np.triu(facing, 1))
    left = _left(way)
    # The room is on the left of a face, so the wall's other face is on its right.
    depth = -np.einsum("nek,nk->ne", ends[j] - ends[i, :1], left[i]).mean(axis=1)
    on_i = np.sort(np.einsum("nek,nk->ne", ends[j] - ends[i, :1], way[i]), axis=1)
    length = np.linalg.norm(ends[i, 1] - ends[i, 0], axis=1)
    low, high = np.maximum(on_i[:, 0], 0.0), np.minimum(on_i[:, 1], length)
    fits = (depth > _THICKNESS_M[0]) & (depth < _THICKNESS_M[1]) & (high - low > _LEAST_COMMON_M)
    found = np.flatnonzero(fits)
    found = found[np.argsort(depth[found], kind="stable")]
    return [(int(i[k]), int(j[k]), float(depth[k]), float(low[k]), float(high[k])) for k in found]


def _left(way: Points) -> Points:
    return np.asarray(way[..., ::-1] * np.array([-1.0, 1.0]))


def _common(
    spans: list[tuple[float, float]], span: tuple[float, float]
) -> list[tuple[float, float]]:
    cut = [(max(low, span[0]), min(high, span[1])) for low, high in spans]
    return [(low, high) for low, high in cut if high - low >= _LEAST_COMMON_M]


def _without(
    spans: list[tuple[float, float]], span: tuple[float, float]
) -> list[tuple[float, float]]:
    left = [(low, min(high, span[0])) for low, high in spans]
    right = [(max(low, span[1]), high) for low, high in spans]
    return [(low, high) for low, high in (*left, *right) if high - low > 1e-9]


def _doors(line: NDArray[np.int32], ends: FloatArray, widest: float) -> FloatArray:
    """(D, 2, 2) m, gaps wide enough for a door; those of both faces of a wall are one, in its middle."""
    gaps = door_gaps(line, ends, widest)
    gaps = gaps[np.linalg.norm(gaps[:, 1] - gaps[:, 0], axis=1) >= _DOOR_M] if len(gaps) else gaps
    doors: list[FloatArray] = []
    left = list(gaps)
    while left:
        gap = left.pop(0)
        twins = [
            k for k, other in enumerate(left)
            if np.abs(other[::-1] - gap).max() < _SAME_DOOR_M
            and directions(other[None])[0] @ directions(gap[None])[0] < _OPPOSITE
        ]  # fmt: skip
        if twins:
            gap = 0.5 * (gap + left.pop(twins[0])[::-1])
        doors.append(gap)
    return np.array(doors).reshape(-1, 2, 2)
