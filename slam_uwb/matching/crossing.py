"""Pairs of stations, one of each of two blocks, that see walls in common at ways to merge the blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.survey import StationId
from .batch import compose, invert
from .evidence import Block
from .index import ScanIndex
from .sight import Sights, may_meet


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """Two stations of two blocks, at the candidates that bring them near enough to see a wall in common."""

    i: StationId
    """Of the first block."""
    j: StationId
    """Of the second."""
    near: NDArray[np.intp]
    """(M,) numbers of the candidates."""
    i_T_j: FloatArray
    """(M, 3)"""
    b_T_j: Pose2


@dataclass(frozen=True, slots=True, eq=False)
class Witnesses:
    """The I stations of a block in arrays."""

    stations: tuple[StationId, ...]
    station_T_block: FloatArray
    """(I, 3)"""
    sights: Sights


def witnesses(block: Block, scans: Mapping[StationId, ScanIndex]) -> Witnesses:
    """The stations of a block, to be asked of those of another."""
    return Witnesses(
        tuple(block.poses),
        invert(np.array([pose.vector for pose in block.poses.values()])),
        Sights.of([scans[station].sight for station in block.poses]),
    )


def crossing(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> Iterator[Crossing]:
    """Every pair of stations across two blocks, at candidates a_T_b (K, 3); one station of `b` after the other."""
    every, of_a = np.arange(len(candidates)), witnesses(a, scans)
    for j, b_T_j in b.poses.items():
        yield from crossing_one(of_a, j, b_T_j, candidates, every, scans)


def crossing_one(
    a: Witnesses,
    j: StationId,
    b_T_j: Pose2,
    candidates: FloatArray,
    numbers: NDArray[np.intp],
    scans: Mapping[StationId, ScanIndex],
) -> Iterator[Crossing]:
    """A station of `b` with every station of `a`, at those of the candidates that have these numbers."""
    a_T_j = compose(candidates[numbers], b_T_j.vector)
    i_T_j = compose(a.station_T_block[:, None], a_T_j)
    met = may_meet(a.sights, scans[j].sight, i_T_j)
    for index in np.flatnonzero(met.any(axis=1)):
        near = met[index]
        yield Crossing(a.stations[index], j, numbers[near], i_T_j[index, near], b_T_j)
