"""Cells of wall lines -> stretches of wall: seen, or hidden in between."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.settings import MappingSettings
from .ragged import ragged
from .wall_evidence import WallCells
from .wall_lines import WallLines


@dataclass(frozen=True, slots=True, eq=False)
class WallRuns:
    """Stretches of the lines, in the order of lines and places along them; none overlaps another."""

    line: NDArray[np.int64]
    """(R,) number of the line."""
    span: FloatArray
    """(R, 2) m along the line's direction, begin and end."""
    chain: NDArray[np.int64]
    """(R,) number of the row of seen stretches, no further apart than a door, that it belongs to."""
    support: FloatArray
    """(R,) m seen in that row."""
    seen: NDArray[np.bool_]
    """(R,) False where the stretch lies hidden between seen ones."""
    raised: FloatArray
    """(R,) share in which raised scans saw a wall minus share in which they looked over it, -1 to 1; 0 unknown."""

    def ends(self, lines: WallLines) -> FloatArray:
        """(R, 2, 2) m, world frame."""
        low, high = (lines.points(self.line, self.span[:, side]) for side in (0, 1))
        return np.stack([low, high], axis=1)

    def part(self, which: NDArray[np.int64]) -> WallRuns:
        """The runs with these numbers."""
        return WallRuns(*(getattr(self, field.name)[which] for field in fields(self)))

    def joined(self, other: WallRuns) -> WallRuns:
        """These runs and then the others."""
        return WallRuns(
            *(
                np.concatenate([getattr(self, field.name), getattr(other, field.name)])
                for field in fields(self)
            )
        )


def wall_runs(cells: WallCells, settings: MappingSettings) -> WallRuns:
    """Seen stretches, and the gaps between two on one line that furniture or shadow explains.

    A gap is filled where it is short and hardly any of it was looked through; a door was looked
    through. Support adds up over what is filled, and over gaps as wide as a door, looked through or
    not: a wall goes on behind its door.
    """
    wall = cells.wall
    changes = (np.diff(cells.line) != 0) | (np.diff(wall.astype(np.int8)) != 0)
    cuts = np.flatnonzero(changes) + 1
    first = np.concatenate([[0], cuts])[: len(cuts) + (len(wall) > 0)]
    last = np.concatenate([cuts, [len(wall)]])[: len(first)]
    line, seen = cells.line[first], wall[first]
    lengths = (last - first) * settings.wall_cell_m
    looked_through = _sums(cells.free, first, last) / np.maximum(last - first, 1)
    raised = _sums(cells.raised_wall, first, last) - _sums(cells.raised_free, first, last)
    raised = raised / np.maximum(last - first, 1)
    same = np.concatenate([[False], line[1:] == line[:-1], [False]])
    between = ~seen & same[:-1] & same[1:]
    filled = (
        between
        & (lengths < settings.wall_fill_gap_m)
        & (looked_through < settings.wall_fill_free_share)
    )
    chain = np.cumsum(~seen & ~filled & ~(between & (lengths < settings.wall_chain_gap_m)))
    support = np.bincount(chain, weights=lengths * seen)[chain] if len(chain) else lengths

    kept = seen | filled
    return WallRuns(
        line[kept],
        _spans(cells, first, last, seen, settings.wall_cell_m)[kept],
        chain[kept],
        support[kept],
        seen[kept],
        raised[kept],
    )


def _spans(
    cells: WallCells,
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    seen: NDArray[np.bool_],
    cell: float,
) -> FloatArray:
    """(R, 2) m: as far as a seen run was seen within its outermost cells, and the gaps up to there."""
    low, high = cells.start[first], cells.start[first] + (last - first) * cell
    begins, ends = cells.first_hit[first], cells.last_hit[last - 1]
    low = np.where(seen & np.isfinite(begins), begins, low)
    high = np.where(seen & np.isfinite(ends), ends, high)
    # Nothing is hidden beyond the ends of the first line and the last.
    gap = np.flatnonzero(~seen[1:-1]) + 1
    low[gap], high[gap] = high[gap - 1], low[gap + 1]
    return np.column_stack([low, high])


def _sums(flags: NDArray[np.bool_], first: np.ndarray, last: np.ndarray) -> FloatArray:
    total = np.concatenate([[0], np.cumsum(flags)])
    return np.asarray(total[last] - total[first], dtype=np.float64)


def free_share(
    cells: WallCells, line: NDArray[np.int64], low: FloatArray, high: FloatArray, cell: float
) -> FloatArray:
    """(N,) share 0-1 of the stretches from `low` to `high` m of the lines that scans looked through."""
    first = np.searchsorted(cells.line, line)
    count = np.searchsorted(cells.line, line, side="right") - first
    begin = cells.start[np.minimum(first, len(cells.start) - 1)]
    low_cell = np.clip(np.round((low - begin) / cell).astype(np.int64), 0, count)
    high_cell = np.clip(np.round((high - begin) / cell).astype(np.int64), low_cell, count)
    through = _sums(cells.free, first + low_cell, first + high_cell)
    return np.asarray(through / np.maximum(high_cell - low_cell, 1))


def near_pairs(
    runs: WallRuns, lines: WallLines, distance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (i, j) of different runs that may be `distance` m apart or less, each pair both ways round.

    None that is so near is left out; some that are further apart are in.
    """
    ends = runs.ends(lines)
    low, high = ends.min(axis=1), ends.max(axis=1) + distance
    order = np.argsort(low[:, 0], kind="stable")
    # Along x by sorting, so that memory goes with the pairs and not with their square.
    behind = np.searchsorted(low[order, 0], high[order, 0], side="right")
    place, step = ragged(behind - np.arange(len(order)) - 1)
    i, j = order[place], order[place + 1 + step]
    touch = (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
    i, j = i[touch], j[touch]
    return np.concatenate([i, j]), np.concatenate([j, i])
