"""Stations of two blocks that see walls in common at ways to merge the blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.survey import StationId
from .batch import compose, invert
from .evidence import Block
from .index import ScanIndex
from .lanes import Lanes, lanes
from .sight import Sights, may_meet


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """A station of the second block with those of the first that may see a wall in common with it.

    At candidates that bring it near enough to some of them. Where it is not near enough to another of
    them, neither says anything of the other.
    """

    j: StationId
    """Of the second block."""
    witnesses: tuple[StationId, ...]
    """L stations of the first."""
    numbers: NDArray[np.intp]
    """(M,) of the candidates."""
    i_T_j: FloatArray
    """(L, M, 3)"""
    b_T_j: Pose2

    def lanes(self, scans: Mapping[StationId, ScanIndex]) -> Lanes:
        """The station's points on the walls of each of its witnesses."""
        return lanes([(scans[i], scans[self.j]) for i in self.witnesses])

    def lanes_back(self, scans: Mapping[StationId, ScanIndex]) -> Lanes:
        """The points of each of its witnesses on the station's walls."""
        return lanes([(scans[self.j], scans[i]) for i in self.witnesses])

    def at(self, kept: NDArray[np.bool_]) -> Crossing | None:
        """The same at those of its candidates that are kept (K,) of all; None where none is."""
        left = kept[self.numbers]
        if not left.any():
            return None
        return replace(self, numbers=self.numbers[left], i_T_j=self.i_T_j[:, left])


@dataclass(frozen=True, slots=True, eq=False)
class Witnesses:
    """The I stations of a block in arrays."""

    stations: tuple[StationId, ...]
    station_T_block: FloatArray
    """(I, 3)"""
    sights: Sights


def witnesses(block: Block) -> Witnesses:
    """The stations of a block, to be asked of those of another."""
    return Witnesses(
        tuple(block.poses),
        invert(np.array([pose.vector for pose in block.poses.values()])),
        block.sights,
    )


def crossing(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> Iterator[Crossing]:
    """Each station of `b` that meets any of `a` at candidates a_T_b (K, 3)."""
    every, of_a = np.arange(len(candidates)), witnesses(a)
    for j, b_T_j in b.poses.items():
        crossed = crossing_one(of_a, j, b_T_j, candidates, every, scans)
        if crossed is not None:
            yield crossed


def crossing_one(
    a: Witnesses,
    j: StationId,
    b_T_j: Pose2,
    candidates: FloatArray,
    numbers: NDArray[np.intp],
    scans: Mapping[StationId, ScanIndex],
) -> Crossing | None:
    """A station of `b` with those of `a` at the candidates of these numbers.

    None where none meets it.
    """
    a_T_j = compose(candidates[numbers], b_T_j.vector)
    i_T_j = compose(a.station_T_block[:, None], a_T_j)
    met = may_meet(a.sights, scans[j].sight, i_T_j)
    near, rows = np.flatnonzero(met.any(axis=0)), np.flatnonzero(met.any(axis=1))
    if not len(near):
        return None
    stations = tuple(a.stations[row] for row in rows)
    return Crossing(j, stations, numbers[near], i_T_j[np.ix_(rows, near)], b_T_j)
