"""Which scans may say anything of each other's walls where a pose brings them: a coarse test before the exact one.

Two stations that are near enough to see a wall in common mostly do not: walls stand between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.products import PreparedScan

_CELL_M = 1.0
_SIDE = 64  # cells; what lies outside counts as the nearest of them
_PLACE_M = 0.5
_SAID_M = 0.5  # of points further from all walls of a scan only its free space tells anything
_DIAGONAL = math.sqrt(0.5)  # of half a cell
# From a point to the middle of its place, to that of its cell, and from there to that of the cell of
# what is known.
_ROUNDING_M = _DIAGONAL * (_PLACE_M + 2.0 * _CELL_M)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Where one scan has walls, and what it may say something of; coarsely, in the scanner's frame."""

    places: FloatArray
    """(P, 2) m, middles of the half-metre cells that hold its points."""
    known: NDArray[np.bool_]
    """(C,) cells of 1 m in some of which it may confirm or deny a wall."""
    reach: float
    """m to the furthest point."""


def coarse_sight(scan: PreparedScan) -> Sight:
    """Where a scan has walls, and where it may say something of those of others."""
    from scipy.ndimage import distance_transform_edt

    seen = np.zeros(_SIDE * _SIDE, dtype=bool)
    seen[_cells(*scan.points.T)] = True
    seen[_cells(*_free_places(scan.free_ranges).T)] = True
    away = distance_transform_edt(~seen.reshape(_SIDE, _SIDE), sampling=_CELL_M)
    places = np.unique(np.floor(scan.points / _PLACE_M), axis=0)
    return Sight(
        places=(places + 0.5) * _PLACE_M,
        known=(away <= _SAID_M + _ROUNDING_M).ravel(),
        reach=float(np.hypot(*scan.points.T).max()),
    )


def _free_places(free_ranges: FloatArray) -> FloatArray:
    """(F, 2) m, places no further than half a cell from each other that the scanner looked through."""
    sector = 2.0 * math.pi / len(free_ranges)
    bearings = (np.arange(len(free_ranges)) + 0.5) * sector - math.pi
    ranges = np.arange(0.0, free_ranges.max(initial=0.0), 0.5 * _CELL_M)
    sectors, steps = np.nonzero(ranges < free_ranges[:, None])
    along = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return np.asarray(along[sectors] * ranges[steps, None])


def _cells(x: FloatArray, y: FloatArray) -> NDArray[np.intp]:
    """(...,) number of the cell of each place (x, y), m."""
    column, row = (np.floor(along / _CELL_M).astype(np.intp) + _SIDE // 2 for along in (x, y))
    for cells in (column, row):
        np.minimum(np.maximum(cells, 0, out=cells), _SIDE - 1, out=cells)
    row *= _SIDE
    row += column
    return np.asarray(row)


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """Those of I scans in arrays."""

    places: FloatArray
    """(I, P, 2); where a scan has fewer, some of them again."""
    known: NDArray[np.bool_]
    """(I, C)"""
    reach: FloatArray
    """(I,) m"""

    @classmethod
    def of(cls, sights: Sequence[Sight]) -> Sights:
        """All of them; there must be one."""
        most = max(len(sight.places) for sight in sights)
        return cls(
            np.stack([np.resize(sight.places, (most, 2)) for sight in sights]),
            np.stack([sight.known for sight in sights]),
            np.array([sight.reach for sight in sights]),
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> Sights:
        """Some of the scans."""
        return Sights(self.places[rows], self.known[rows], self.reach[rows])

    def __add__(self, other: Sights) -> Sights:
        """Those of both, one after the other."""
        most = max(self.places.shape[1], other.places.shape[1])
        return Sights(
            np.concatenate([_repeated(self.places, most), _repeated(other.places, most)]),
            np.concatenate([self.known, other.known]),
            np.concatenate([self.reach, other.reach]),
        )


def _repeated(places: FloatArray, count: int) -> FloatArray:
    """(I, `count`, 2) the places (I, P, 2), the first of them again where there are fewer."""
    return places[:, np.arange(count) % places.shape[1]]


def may_meet(ones: Sights, other: Sight, ones_T_other: FloatArray) -> NDArray[np.bool_]:
    """(I, K) whether each scan and the other may speak of each other's walls at poses one_T_other (I, K, 3).

    Where it is False, neither has a partner for any of the other's points within half a metre, nor looked
    through any.
    """
    apart = np.hypot(ones_T_other[..., 0], ones_T_other[..., 1])
    met = apart <= ones.reach[:, None] + other.reach + _SAID_M
    rows, columns = np.nonzero(met)
    met[rows, columns] = _know_places(ones, rows, other, ones_T_other[rows, columns])
    return np.asarray(met)


def _know_places(
    ones: Sights, rows: NDArray[np.intp], other: Sight, one_T_other: FloatArray
) -> NDArray[np.bool_]:
    """(R,) whether scan `rows` (R,) of some or the other knows a place where the other has walls."""
    x, y, theta = one_T_other.T[..., None]
    c, s = np.cos(theta), np.sin(theta)
    u, v = other.places.T
    met = _any_known(ones.known, rows, x + c * u - s * v, y + s * u + c * v)
    # The way back where that is not enough: the inverse turns back after the shift.
    left = np.flatnonzero(~met)
    u, v = ones.places[rows[left]].transpose(2, 0, 1)
    u, v, c, s = u - x[left], v - y[left], c[left], s[left]
    nobody = np.zeros(len(left), dtype=np.intp)
    met[left] = _any_known(other.known[None, :], nobody, c * u + s * v, c * v - s * u)
    return met


def _any_known(
    known: NDArray[np.bool_], rows: NDArray[np.intp], x: FloatArray, y: FloatArray
) -> NDArray[np.bool_]:
    """(R,) whether any of the places (R, P) is in a cell known (I, C) to scan `rows` (R,)."""
    cells = _cells(x, y)
    cells += known.shape[1] * rows[:, None]
    return np.asarray(known.ravel().take(cells).any(axis=-1))
