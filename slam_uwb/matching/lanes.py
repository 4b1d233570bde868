"""Many pairs of scans as one set of arrays, so that what is done for each is done in one go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .batch import invert
from .index import ScanIndex, table_cells

_PAIRS_AT_ONCE, _PAIRS_SHARED = 32, 16

ScanPair = tuple[ScanIndex, ScanIndex]
"""Target and source."""


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """L pairs of scans: in each lane the points of a source meet the walls of a target.

    Has what a `ScanIndex` has where points are paired, and stands there for target and source
    alike. Most poses of a pair are few: starting an operation then takes longer than doing it, so
    doing it for all lanes at once takes a fraction of the time. Shorter scans are filled up to the
    P points of the longest with points of no length.
    """

    targets: tuple[ScanIndex, ...]
    table_turn: FloatArray
    """(L, 1, 1) of the targets."""
    table_columns: FloatArray
    """(4, L P) of the targets, one after the other."""
    left: FloatArray
    """(L, 1, 1) m, where their tables begin."""
    bottom: FloatArray
    width: NDArray[np.int32]
    """(L, 1, 1) cells of their tables."""
    height: NDArray[np.int32]
    reliable: NDArray[np.bool_]
    """(L P,) of the targets."""
    columns: FloatArray
    """(4, L, 1, P) of the sources."""
    lengths: FloatArray
    """(L, 1, P) of the sources, zero where there is no point."""
    on_wall: NDArray[np.bool_]
    """(L, 1, P) of the sources."""

    def nearest_in_table(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """(L, K, N) number, among all L P, of the point nearest to (x, y) (L, K, N) in table axes, nearly."""
        cells = table_cells(x - self.left, y - self.bottom, self.width, self.height)
        found = np.empty(cells.shape, dtype=np.int32)
        for scan, cell, nearest in zip(self.targets, cells, found, strict=True):
            scan.table.ravel().take(cell, out=nearest, mode="clip")
        found += self._first_points()
        return found

    def nearest_by_search(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """The same by search."""
        found = [scan.nearest_by_search(x[k], y[k]) for k, scan in enumerate(self.targets)]
        return np.asarray(np.stack(found) + self._first_points())

    def free_range(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(L, K, N) metres looked through towards the places (x, y) (L, K, N) in table axes; 0 = unknown."""
        bearing = np.arctan2(y, x)
        found = np.empty_like(bearing)
        for scan, towards, metres in zip(self.targets, bearing, found, strict=True):
            scan.free_range_towards(towards, out=metres)
        return found

    def of(self, kept: NDArray[np.bool_]) -> Lanes:
        """Those of the lanes that are kept (L,)."""
        count, points = len(self.targets), self.lengths.shape[-1]
        return Lanes(
            targets=tuple(scan for scan, stays in zip(self.targets, kept, strict=True) if stays),
            table_turn=self.table_turn[kept],
            table_columns=self.table_columns.reshape(4, count, points)[:, kept].reshape(4, -1),
            left=self.left[kept],
            bottom=self.bottom[kept],
            width=self.width[kept],
            height=self.height[kept],
            reliable=self.reliable.reshape(count, points)[kept].ravel(),
            columns=self.columns[:, kept],
            lengths=self.lengths[kept],
            on_wall=self.on_wall[kept],
        )

    def _first_points(self) -> NDArray[np.int32]:
        """(L, 1, 1) number of the first point of each target."""
        count, points = len(self.targets), self.lengths.shape[-1]
        first = points * np.arange(count, dtype=np.int32)
        return np.asarray(first.reshape(-1, 1, 1))


def lanes(pairs: Sequence[ScanPair]) -> Lanes:
    """The pairs (target, source), one a lane; there must be one."""
    count = max(len(scan.lengths) for pair in pairs for scan in pair)
    fixed = np.zeros((4, len(pairs), count))
    moving = np.zeros((4, len(pairs), 1, count))
    lengths = np.zeros((len(pairs), 1, count))
    reliable = np.zeros((len(pairs), count), dtype=bool)
    on_wall = np.zeros((len(pairs), 1, count), dtype=bool)
    for k, (target, source) in enumerate(pairs):
        of_target, of_source = len(target.lengths), len(source.lengths)
        fixed[:, k, :of_target] = target.table_columns
        reliable[k, :of_target] = target.reliable
        moving[:, k, 0, :of_source] = source.columns
        lengths[k, 0, :of_source] = source.lengths
        on_wall[k, 0, :of_source] = source.on_wall
    targets = tuple(target for target, _ in pairs)
    places = np.array([(*scan.table_origin, scan.table_turn) for scan in targets])
    shapes = np.array([scan.table.shape for scan in targets], dtype=np.int32)
    left, bottom, table_turn = places.T.reshape(3, -1, 1, 1)
    height, width = shapes.T.reshape(2, -1, 1, 1)
    return Lanes(
        targets=targets,
        left=left,
        bottom=bottom,
        width=width,
        height=height,
        table_turn=table_turn,
        table_columns=fixed.reshape(4, -1),
        reliable=reliable.ravel(),
        columns=moving,
        lengths=lengths,
        on_wall=on_wall,
    )


def lanes_both_ways(pairs: Sequence[ScanPair]) -> Lanes:
    """2 Q lanes of Q pairs: each pair's source on its target, then, in the same order, the other way round."""
    return lanes([*pairs, *((source, target) for target, source in pairs)])


def both_ways(poses: FloatArray) -> FloatArray:
    """(2 Q, K, 3) poses target_T_source (Q, K, 3) of Q pairs, then their inverses."""
    return np.concatenate([poses, invert(poses)])


def shared_parts(count: int) -> Iterator[slice]:
    """Smaller parts of `count` pairs, so that processes that share them out end together."""
    for first in range(0, count, _PAIRS_SHARED):
        yield slice(first, first + _PAIRS_SHARED)


def in_parts(count: int) -> Iterator[slice]:
    """Parts of `count` pairs that are done at once: arrays beyond the cache lose what that gains."""
    for first in range(0, count, _PAIRS_AT_ONCE):
        yield slice(first, first + _PAIRS_AT_ONCE)
