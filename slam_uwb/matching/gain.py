"""What two blocks gain by being merged, and the merged block."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import invert
from .crossing import Crossing, crossing, crossing_one, witnesses
from .evidence import STRIDE, Block, Seen, evidence_of, lengths_of
from .index import ScanIndex
from .score import PointEvidence, point_evidence


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
    of_a, crossed = witnesses(a, scans), list[Crossing]()
    for j, alone in b.seen.items():
        live = np.flatnonzero(gains >= least)
        pairs = list(crossing_one(of_a, j, b.poses[j], candidates, live, scans))
        seen = _repeated(alone, len(candidates))
        for pair in pairs:
            _add(seen, pair.near, said_of_second(pair, scans, settings))
        gains += _gain(seen, alone, scans[j], settings)
        crossed += pairs
    gains[gains < least] = -math.inf
    seen_of_a: dict[StationId, Seen] = {}
    for pair in _only(crossed, gains >= least):
        if pair.i not in seen_of_a:
            seen_of_a[pair.i] = _repeated(a.seen[pair.i], len(candidates))
        _add(seen_of_a[pair.i], pair.near, _said_of_first(pair, scans, settings))
    for i, seen in seen_of_a.items():
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
