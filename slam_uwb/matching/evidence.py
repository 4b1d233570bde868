"""Evidence of merged maps: blocks of stations, and what the scans of a block say of each other's walls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import compose, invert
from .index import ScanIndex, within_sight
from .score import point_evidence

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


def crossing(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> Iterator[Crossing]:
    """Every pair of stations across two blocks, at candidates a_T_b (K, 3)."""
    for j, b_T_j in b.poses.items():
        a_T_j = compose(candidates, np.tile(b_T_j.vector, (len(candidates), 1)))
        for i, a_T_i in a.poses.items():
            apart = np.hypot(a_T_j[:, 0] - a_T_i.x, a_T_j[:, 1] - a_T_i.y)
            near = np.flatnonzero(within_sight(scans[i], scans[j], apart))
            if len(near):
                a_T_i_inverse = np.tile(a_T_i.inverse().vector, (len(near), 1))
                yield Crossing(i, j, near, compose(a_T_i_inverse, a_T_j[near]), b_T_j)


def _cross_seen(
    a: Block,
    b: Block,
    candidates: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> tuple[dict[StationId, Seen], dict[StationId, Seen]]:
    """What the scans of each block say of the points of the other's, with arrays (K, N) over the candidates."""
    seen_a = {i: _broadcast(seen, len(candidates)) for i, seen in a.seen.items()}
    seen_b = {j: _broadcast(seen, len(candidates)) for j, seen in b.seen.items()}
    for pair in crossing(a, b, candidates, scans):
        for seen, witness, pose in (
            (seen_b[pair.j], (pair.i, pair.j), pair.i_T_j),
            (seen_a[pair.i], (pair.j, pair.i), invert(pair.i_T_j)),
        ):
            target, source = witness
            said = point_evidence(scans[target], scans[source], pose, settings, STRIDE)
            seen.hits[pair.near] += said.hit
            seen.best[pair.near] = np.maximum(seen.best[pair.near], said.hit)
            seen.through[pair.near] += said.seen_through
    return seen_a, seen_b


def _broadcast(seen: Seen, count: int) -> Seen:
    return Seen(*(np.tile(values, (count, 1)) for values in (seen.hits, seen.best, seen.through)))


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
) -> FloatArray:
    """(K,) evidence of the merged map minus that of the two blocks apart."""
    apart = total_evidence(a, scans, settings) + total_evidence(b, scans, settings)
    together = sum(
        evidence_of(seen, lengths_of(scans[station]), settings)
        for side in _cross_seen(a, b, candidates, scans, settings)
        for station, seen in side.items()
    )
    return np.asarray(together - apart)


def merge_blocks(
    a: Block,
    b: Block,
    a_T_b: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> Block:
    """One block in the frame of `a`."""
    pose = Pose2.from_vector(a_T_b)
    seen_a, seen_b = _cross_seen(a, b, a_T_b[None, :], scans, settings)
    seen = {
        station: Seen(values.hits[0], values.best[0], values.through[0])
        for station, values in (seen_a | seen_b).items()
    }
    moved = {station: pose @ place for station, place in b.poses.items()}
    groups = tuple(frozenset(part.poses) for part in (a, b) if len(part.poses) > 1)
    return Block({**a.poses, **moved}, seen, (*a.parts, *b.parts, *groups))
