"""Evidence of merged maps: blocks of stations, and what the scans of a block say of each other's walls."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import compose, invert
from .index import ScanIndex
from .score import PointEvidence, point_evidence
from .sight import Sights, may_meet

STRIDE = 2
"""Every second point is enough to weigh walls."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the other scans of its block say of the points of one scan."""

    hits: FloatArray
    """(N,) soft number of scans that confirm the point."""
    best: FloatArray
    """(N,) how well the best of them does, 0-1."""
    through: FloatArray
    """(N,) soft number of scans that looked through it."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Stations that hold together."""

    poses: Mapping[StationId, Pose2]
    """block_T_station; the block's frame is that of its first station."""
    seen: Mapping[StationId, Seen]
    parts: tuple[frozenset[StationId], ...] = ()
    """Groups of two stations and more that were blocks before they were merged into this one."""


def single_block(station: StationId, scan: ScanIndex) -> Block:
    """One station alone, in its own frame; nobody confirms what it sees."""
    zero = np.zeros(len(scan.scan.points[::STRIDE]))
    return Block({station: Pose2.identity()}, {station: Seen(zero, zero, zero)})


def evidence_of(seen: Seen, lengths: FloatArray, settings: MatchingSettings) -> FloatArray:
    """Metres of a scan's wall that hold minus weighted metres looked through; sums over the last axis.

    A wall counts once a scan, by the best of its witnesses and by the share of them that deny it.
    """
    denied = seen.through / np.maximum(seen.through + seen.hits, 1e-9)
    return np.asarray(
        (seen.best - settings.violation_weight * np.where(seen.through > 0.0, denied, 0.0))
        @ lengths
    )


def lengths_of(scan: ScanIndex) -> FloatArray:
    """(N,) metres of wall that each of the points looked at stands for."""
    return scan.scan.lengths[::STRIDE] * STRIDE


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
class _Witnesses:
    """The I stations of a block in arrays."""

    stations: tuple[StationId, ...]
    station_T_block: FloatArray
    """(I, 3)"""
    sights: Sights


def _witnesses(block: Block, scans: Mapping[StationId, ScanIndex]) -> _Witnesses:
    return _Witnesses(
        tuple(block.poses),
        invert(np.array([pose.vector for pose in block.poses.values()])),
        Sights.of([scans[station].sight for station in block.poses]),
    )


def crossing(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> Iterator[Crossing]:
    """Every pair of stations across two blocks, at candidates a_T_b (K, 3); one station of `b` after the other."""
    every, witnesses = np.arange(len(candidates)), _witnesses(a, scans)
    for j, b_T_j in b.poses.items():
        yield from _crossing_one(witnesses, j, b_T_j, candidates, every, scans)


def _crossing_one(
    of_a: _Witnesses,
    j: StationId,
    b_T_j: Pose2,
    candidates: FloatArray,
    numbers: NDArray[np.intp],
    scans: Mapping[StationId, ScanIndex],
) -> Iterator[Crossing]:
    """A station of `b` with every station of `a`, at those of the candidates that have these numbers."""
    a_T_j = compose(candidates[numbers], b_T_j.vector)
    i_T_j = compose(of_a.station_T_block[:, None], a_T_j)
    met = may_meet(of_a.sights, scans[j].sight, i_T_j)
    for index in np.flatnonzero(met.any(axis=1)):
        near = met[index]
        yield Crossing(of_a.stations[index], j, numbers[near], i_T_j[index, near], b_T_j)


def total_evidence(
    block: Block, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> float:
    """Metres of wall in a block's map that hold, minus weighted metres looked through."""
    return sum(
        float(evidence_of(seen, lengths_of(scans[station]), settings))
        for station, seen in block.seen.items()
    )


def merge_gains(
    a: Block,
    b: Block,
    candidates: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    *,
    least: float = -math.inf,
) -> FloatArray:
    """(K,) evidence of the merged map minus that of the two blocks apart, at candidates a_T_b (K, 3).

    A candidate is given up, with a gain of minus infinity, when what `a` says of the stations of `b`, one
    after the other, comes to less than `least`.
    """
    gains = np.zeros(len(candidates))
    witnesses, crossed = _witnesses(a, scans), list[Crossing]()
    for j, alone in b.seen.items():
        live = np.flatnonzero(gains >= least)
        pairs = list(_crossing_one(witnesses, j, b.poses[j], candidates, live, scans))
        seen = _repeated(alone, len(candidates))
        for pair in pairs:
            _add(seen, pair.near, said_of_second(pair, scans, settings))
        gains += _gain(seen, alone, scans[j], settings)
        crossed += pairs
    gains[gains < least] = -math.inf
    of_a: dict[StationId, Seen] = {}
    for pair in _only(crossed, gains >= least):
        if pair.i not in of_a:
            of_a[pair.i] = _repeated(a.seen[pair.i], len(candidates))
        _add(of_a[pair.i], pair.near, _said_of_first(pair, scans, settings))
    for i, seen in of_a.items():
        gains += _gain(seen, a.seen[i], scans[i], settings)
    return gains


def _only(pairs: Iterable[Crossing], live: NDArray[np.bool_]) -> Iterator[Crossing]:
    """The crossings at the candidates that are left."""
    for pair in pairs:
        kept = live[pair.near]
        if kept.any():
            yield replace(pair, near=pair.near[kept], i_T_j=pair.i_T_j[kept])


def _gain(together: Seen, alone: Seen, scan: ScanIndex, settings: MatchingSettings) -> FloatArray:
    """(K,) what new witnesses add to the evidence of one scan's walls."""
    lengths = lengths_of(scan)
    return evidence_of(together, lengths, settings) - evidence_of(alone, lengths, settings)


def said_of_second(
    pair: Crossing, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> PointEvidence:
    """What the first block's station says of the points of the second's."""
    return point_evidence(scans[pair.i], scans[pair.j], pair.i_T_j, settings, STRIDE)


def _said_of_first(
    pair: Crossing, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> PointEvidence:
    """The reverse."""
    return point_evidence(scans[pair.j], scans[pair.i], invert(pair.i_T_j), settings, STRIDE)


def _add(seen: Seen, numbers: NDArray[np.intp], said: PointEvidence) -> None:
    """Add what one more scan says, at the candidates of these numbers, to what is seen (K, N)."""
    seen.hits[numbers] += said.hit
    seen.best[numbers] = np.maximum(seen.best[numbers], said.hit)
    seen.through[numbers] += said.seen_through


def _repeated(seen: Seen, count: int) -> Seen:
    return Seen(*(np.tile(values, (count, 1)) for values in (seen.hits, seen.best, seen.through)))


def merge_blocks(
    a: Block,
    b: Block,
    a_T_b: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> Block:
    """One block in the frame of `a`."""
    pose = Pose2.from_vector(a_T_b)
    seen = {station: _repeated(alone, 1) for station, alone in {**a.seen, **b.seen}.items()}
    for pair in crossing(a, b, a_T_b[None, :], scans):
        _add(seen[pair.j], pair.near, said_of_second(pair, scans, settings))
        _add(seen[pair.i], pair.near, _said_of_first(pair, scans, settings))
    moved = {station: pose @ place for station, place in b.poses.items()}
    groups = tuple(frozenset(part.poses) for part in (a, b) if len(part.poses) > 1)
    return Block(
        {**a.poses, **moved},
        {s: Seen(v.hits[0], v.best[0], v.through[0]) for s, v in seen.items()},
        (*a.parts, *b.parts, *groups),
    )
