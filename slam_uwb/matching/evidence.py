"""Evidence of merged maps: blocks of stations, and what the scans of a block say of each other's walls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .index import ScanIndex
from .sight import Sights

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
    sights: Sights
    """Of its stations, in their order."""
    parts: tuple[frozenset[StationId], ...] = ()
    """Groups of two stations and more that were blocks before they were merged into this one."""


def single_block(station: StationId, scan: ScanIndex) -> Block:
    """One station alone, in its own frame; nobody confirms what it sees."""
    zero = np.zeros(len(scan.scan.points[::STRIDE]))
    seen = {station: Seen(zero, zero, zero)}
    return Block({station: Pose2.identity()}, seen, Sights.of([scan.sight]))


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


def total_evidence(
    block: Block, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> float:
    """Metres of wall in a block's map that hold, minus weighted metres looked through."""
    return sum(
        float(evidence_of(seen, lengths_of(scans[station]), settings))
        for station, seen in block.seen.items()
    )
