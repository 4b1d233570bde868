"""How many walls the straight path of a link may cross: pieces of wall -> probabilities.

Every wall blocks with its own probability, so the number of walls is Poisson-binomial. Crossings
closer together than a wall is thick are the two faces of one wall. An anchor hangs on a wall, on one
side of it or the other: its place is taken as uncertain, which also makes the labels smooth functions
of the place, so that labels and places that depend on each other settle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ..model.geometry import FloatArray, Points
from ..model.products import WallPieces
from .density import MAX_WALLS

WALL_THICKNESS_M = 0.30
"""Faces closer than this, square to the wall, are one wall (joint study, 4)."""
HALF_WALL_M = 0.08
"""A wall is crossed where its middle is: what hangs on a face is before it, however thick the noise."""
PLACE_SIGMA_M = 0.08
"""Of an anchor's place and of walls', for its labels; the study averaged over 0.08 m to either side."""

_Coordinate = Callable[[Points, NDArray[np.intp], NDArray[np.intp]], FloatArray]

_REACH = 5.0  # standard deviations beyond which a piece is certainly crossed or not
_LEAST_COSINE = 0.1  # between path and a wall's normal: a path along a wall crosses it anywhere
_LEAST_PROBABILITY = 1e-6  # of a crossing that counts; labels jump by no more
_GRAZED_M = _REACH * PLACE_SIGMA_M / _LEAST_COSINE
"""A wall that a path grazes may be met that much further along."""
_CLOSE_M = 2.0  # places within this radius are looked at together
_CHUNK = 1_000_000  # pairs of path and piece at a time: 100 MB


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """The wall lines that M paths may cross, C at most, in the order of the path."""

    probability: FloatArray
    """(M, C) that the path crosses there and is blocked; 0 where there is no more."""
    same_wall: NDArray[np.bool_]
    """(M, C) whether it is another face of the wall before."""

    def wall_probabilities(self) -> FloatArray:
        """(M, MAX_WALLS + 1) of 0, 1, ... walls."""
        walls = self.probability.copy()
        # From the last face back to the first, the larger probability is handed on.
        for k in range(walls.shape[1] - 1, 0, -1):
            same = self.same_wall[:, k]
            larger = np.maximum(walls[:, k - 1], walls[:, k])
            walls[:, k - 1] = np.where(same, larger, walls[:, k - 1])
            walls[:, k] = np.where(same, 0.0, walls[:, k])
        counts = np.zeros((len(walls), MAX_WALLS + 1))
        counts[:, 0] = 1.0
        for column in walls.T:
            counts = _one_more(counts, column)
        return counts


def count_walls(pieces: WallPieces, tags: FloatArray, places: FloatArray) -> FloatArray:
    """(..., MAX_WALLS + 1) probability of 0, 1, ... walls between tags (..., 2) and places (..., 2), m.

    Many places that lie close together, seen from the same tags, cost little: tags (N, 2) and places
    (K, 1, 2).
    """
    shape = np.broadcast_shapes(tags.shape, places.shape)
    starts, ends = (np.broadcast_to(x, shape).reshape(-1, 2) for x in (tags, places))
    pieces = _around(pieces, starts, ends)
    centre = places.reshape(-1, 2).mean(axis=0) if places.size else np.zeros(2)
    reach = float(np.hypot(*(places.reshape(-1, 2) - centre).T).max(initial=0.0))
    if tags.ndim == 2 and places.ndim == 3 and places.shape[1] == 1 and reach < _CLOSE_M:
        path, piece = near_pairs(pieces, tags, np.broadcast_to(centre, tags.shape), reach)
        copies = len(tags) * np.arange(len(places))
        path = (copies[:, None] + path).ravel()
        piece = np.tile(piece, len(places))
        counts = cross(pieces, starts, ends, path, piece).wall_probabilities()
        return counts.reshape(*shape[:-1], MAX_WALLS + 1)
    chunk = max(1, _CHUNK // max(1, len(pieces.ends)))
    parts = [np.zeros((0, MAX_WALLS + 1))]
    for k in range(0, len(starts), chunk):
        rows = slice(k, k + chunk)
        path, piece = near_pairs(pieces, starts[rows], ends[rows], 0.0)
        crossed = cross(pieces, starts[rows], ends[rows], path, piece)
        parts.append(crossed.wall_probabilities())
    return np.concatenate(parts).reshape(*shape[:-1], MAX_WALLS + 1)


def _around(pieces: WallPieces, starts: Points, ends: Points) -> WallPieces:
    """The pieces that any of the paths may cross: of a large building, those of one part of it."""
    if not len(starts):
        return pieces
    points = np.concatenate([starts, ends])
    low, high = points.min(axis=0) - _GRAZED_M, points.max(axis=0) + _GRAZED_M
    near = ((pieces.ends.max(axis=1) >= low) & (pieces.ends.min(axis=1) <= high)).all(axis=1)
    return WallPieces(pieces.ends[near], pieces.line[near], pieces.probability[near])


def near_pairs(
    pieces: WallPieces, starts: Points, ends: Points, reach: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Paths and pieces that may cross if the paths' ends move by up to `reach`, m; no pair is missed."""
    margin = reach + _REACH * PLACE_SIGMA_M
    around = reach + _GRAZED_M
    near = np.ones((len(starts), len(pieces.ends)), dtype=bool)
    for axis in (0, 1):
        low = np.minimum(starts[:, axis], ends[:, axis]) - around
        high = np.maximum(starts[:, axis], ends[:, axis]) + around
        near &= pieces.ends[..., axis].max(axis=1) >= low[:, None]
        near &= pieces.ends[..., axis].min(axis=1) <= high[:, None]
    path, piece = np.nonzero(near)
    direction = ends - starts
    across = np.column_stack([-direction[:, 1], direction[:, 0]])
    across /= np.maximum(np.hypot(*direction.T), 1e-9)[:, None]
    # All ends of pieces beside all paths at once: less work than to pick the near ones first.
    offsets = (pieces.ends @ across.T - np.einsum("ni,ni->n", starts, across)).transpose(2, 0, 1)
    one, other = offsets[path, piece].T
    aside = (np.minimum(one, other) > margin) | (np.maximum(one, other) < -margin)
    return path[~aside], piece[~aside]


def cross(
    pieces: WallPieces,
    starts: Points,
    ends: Points,
    path: NDArray[np.intp],
    piece: NDArray[np.intp],
) -> Crossings:
    """Wall lines crossed by the paths from `starts` (M, 2) to `ends` (M, 2), m, the ends uncertain.

    Args:
        pieces: P pieces of wall.
        starts: where the paths start.
        ends: where they end.
        path: (Q,) which path
        piece: (Q,) may cross which piece.
    """
    path, piece, blocked, along, cosine = _crossed(pieces, starts, ends, path, piece)
    # Pieces of one line share out its crossing: their probabilities add up.
    code = path * (int(pieces.line.max(initial=0)) + 1) + pieces.line[piece]
    order = np.argsort(code, kind="stable")
    _, first = np.unique(code[order], return_index=True)
    blocked = np.add.reduceat(blocked[order], first) if len(first) else blocked
    chosen = order[first]
    order = np.lexsort((along[chosen], path[chosen]))
    blocked, chosen = blocked[order], chosen[order]
    path, along, cosine = path[chosen], along[chosen], cosine[chosen]
    rank = np.arange(len(path)) - np.searchsorted(path, path)
    width = int(rank.max(initial=-1)) + 1
    probability = np.zeros((len(starts), width))
    where, square = np.full((2, len(starts), width), np.inf)
    probability[path, rank] = np.minimum(blocked, 1.0)
    where[path, rank], square[path, rank] = along, cosine
    return Crossings(probability, _same_wall(where, square))


def _crossed(
    pieces: WallPieces,
    starts: Points,
    ends: Points,
    path: NDArray[np.intp],
    piece: NDArray[np.intp],
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
    """Path, piece, probability of being blocked by it, m along the path, |cosine| to the wall's normal."""
    lengths, along_wall, before = _in_axes_of_pieces(pieces)
    # How far the path's end lies beyond the wall, seen from its start.
    from_start, from_end = (before(points, path, piece) + HALF_WALL_M for points in (starts, ends))
    beyond = -np.sign(from_start) * from_end
    # What follows is slow, and most pairs end here.
    reached = np.flatnonzero(beyond > -_REACH * PLACE_SIGMA_M)
    path, piece, beyond = path[reached], piece[reached], beyond[reached]
    from_start, from_end = from_start[reached], from_end[reached]
    apart = np.where(beyond > 0.0, from_start - from_end, 1.0)
    share = np.where(beyond > 0.0, from_start / apart, 1.0)
    begin, end = (along_wall(points, path, piece) for points in (starts, ends))
    lateral = begin + share * (end - begin)
    # Of the path: pieces beyond its end are all met there, in the order of their lines.
    distance = np.hypot(*(ends - starts).T)[path]
    cosine = np.abs(from_end - from_start) / np.maximum(distance, 1e-9)
    sigma = PLACE_SIGMA_M * np.maximum(share, 1e-3) / np.maximum(cosine, _LEAST_COSINE)
    low, high = -lateral / sigma, (lengths[piece] - lateral) / sigma
    hit = np.flatnonzero((low < _REACH) & (high > -_REACH))
    path, piece = path[hit], piece[hit]
    blocked = pieces.probability[piece] * ndtr(beyond[hit] / PLACE_SIGMA_M)
    blocked *= ndtr(high[hit]) - ndtr(low[hit])
    kept = blocked > _LEAST_PROBABILITY
    hit = hit[kept]
    return path[kept], piece[kept], blocked[kept], (share * distance)[hit], cosine[hit]


def _in_axes_of_pieces(pieces: WallPieces) -> tuple[FloatArray, _Coordinate, _Coordinate]:
    """(P,) lengths, m; functions (points (N, 2), which, of which piece) -> m along, and before the piece."""
    first = pieces.ends[:, 0]
    wall = pieces.ends[:, 1] - first
    lengths = np.maximum(np.hypot(*wall.T), 1e-9)
    axis = wall / lengths[:, None]

    def coordinate(axis: FloatArray) -> _Coordinate:
        origin = np.einsum("pi,pi->p", first, axis)
        (x, y), columns = axis.T.copy(), np.ascontiguousarray

        def of(points: Points, which: NDArray[np.intp], piece: NDArray[np.intp]) -> FloatArray:
            px, py = columns(points[:, 0]), columns(points[:, 1])
            return np.asarray(px[which] * x[piece] + py[which] * y[piece] - origin[piece])

        return of

    across = np.column_stack([-axis[:, 1], axis[:, 0]])
    return lengths, coordinate(axis), coordinate(across)


def _same_wall(along: FloatArray, cosine: FloatArray) -> NDArray[np.bool_]:
    """(M, C) whether each crossing belongs to the wall of the crossing before."""
    same = np.zeros(along.shape, dtype=bool)
    if along.shape[1] < 2:
        return same
    begin = along[:, 0].copy()
    for k in range(1, along.shape[1]):
        present = np.isfinite(along[:, k])
        apart = np.where(present, along[:, k], 0.0) - np.where(present, begin, -np.inf)
        same[:, k] = apart * np.minimum(cosine[:, k], 1.0) < WALL_THICKNESS_M
        begin = np.where(same[:, k], begin, along[:, k])
    return same


def _one_more(counts: FloatArray, probability: FloatArray) -> FloatArray:
    """The distribution of the number of walls with one more wall of that probability (M,)."""
    p = probability[:, None]
    more = counts * (1.0 - p)
    more[:, 1:] += counts[:, :-1] * p
    more[:, -1] += counts[:, -1] * probability
    return more
