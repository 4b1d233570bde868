"""Two scans as one set of arrays, so that what is done both ways is done in one go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .batch import invert
from .index import ScanIndex, table_cells


@dataclass(frozen=True, slots=True, eq=False)
class ScanPair:
    """Both scans in both roles: first the source's points on the target, then the other way round.

    Has what a `ScanIndex` has where points are paired, and stands there for target and source
    alike. Most candidates are few: starting an operation then takes longer than doing it, so doing
    both ways at once takes little more than half the time. The shorter scan is filled up to the P
    points of the longer one with points of no length.
    """

    looked_at: tuple[ScanIndex, ScanIndex]
    """The target, the source."""
    table_turn: FloatArray
    """(2, 1, 1) of those looked at."""
    table_columns: FloatArray
    """(4, 2 P) of those looked at, one after the other."""
    left: FloatArray
    """(2, 1, 1) m, where their tables begin."""
    bottom: FloatArray
    width: NDArray[np.int32]
    """(2, 1, 1) cells of their tables."""
    height: NDArray[np.int32]
    reliable: NDArray[np.bool_]
    """(2 P,) of those looked at."""
    columns: FloatArray
    """(4, 2, 1, P) of the source, of the target."""
    lengths: FloatArray
    """(2, 1, P) likewise, zero where there is no point."""
    on_wall: NDArray[np.bool_]
    """(2, 1, P) likewise."""

    def nearest_in_table(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """(2, K, N) number, among all 2 P, of the point nearest to (x, y) (2, K, N) in table axes, nearly."""
        cells = table_cells(x - self.left, y - self.bottom, self.width, self.height)
        found = np.empty(cells.shape, dtype=np.int32)
        for scan, cell, nearest in zip(self.looked_at, cells, found, strict=True):
            scan.table.ravel().take(cell, out=nearest, mode="clip")
        found[1] += self.lengths.shape[-1]
        return found

    def nearest_by_search(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """The same by search."""
        one, other = (scan.nearest_by_search(x[k], y[k]) for k, scan in enumerate(self.looked_at))
        return np.stack([one, other + np.int32(self.lengths.shape[-1])])

    def free_range(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(2, K, N) metres looked through towards the places (x, y) (2, K, N) in table axes; 0 = unknown."""
        return np.stack([scan.free_range(x[k], y[k]) for k, scan in enumerate(self.looked_at)])


def scan_pair(target: ScanIndex, source: ScanIndex) -> ScanPair:
    """The two scans in both roles."""
    count = max(len(target.lengths), len(source.lengths))
    fixed = np.zeros((4, 2, count))
    moving = np.zeros((4, 2, 1, count))
    lengths = np.zeros((2, 1, count))
    flags = np.zeros((2, 2, 1, count), dtype=bool)
    for k, (one, other) in enumerate(((target, source), (source, target))):
        of_one, of_other = len(one.lengths), len(other.lengths)
        fixed[:, k, :of_one] = one.table_columns
        flags[0, k, 0, :of_one] = one.reliable
        moving[:, k, 0, :of_other] = other.columns
        lengths[k, 0, :of_other] = other.lengths
        flags[1, k, 0, :of_other] = other.on_wall
    both = (target, source)
    left, bottom = np.reshape([scan.table_origin for scan in both], (2, 2, 1, 1)).swapaxes(0, 1)
    shapes = np.array([scan.table.shape for scan in both], dtype=np.int32)
    height, width = shapes.reshape(2, 2, 1, 1).swapaxes(0, 1)
    return ScanPair(
        looked_at=both,
        left=left,
        bottom=bottom,
        width=width,
        height=height,
        table_turn=np.reshape([scan.table_turn for scan in both], (2, 1, 1)),
        table_columns=fixed.reshape(4, -1),
        reliable=flags[0].ravel(),
        columns=moving,
        lengths=lengths,
        on_wall=flags[1],
    )


def both_ways(poses: FloatArray) -> FloatArray:
    """(2, K, 3) poses target_T_source (K, 3) and their inverses."""
    return np.stack([poses, invert(poses)])
