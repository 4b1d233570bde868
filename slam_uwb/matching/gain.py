"""What two blocks gain by being merged, and the merged block."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

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

_CANDIDATES_AT_ONCE = 16
_ALIKE_M, _ALIKE_RAD = 5.0, math.pi / 2  # a room, and the corners of most buildings


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

    A candidate is given up, with a gain of minus infinity, when what the larger block says of the
    stations of the smaller one, one after the other, comes to less than `least`.
    """
    if len(b.poses) > len(a.poses):
        return merge_gains(b, a, invert(candidates), scans, settings, least=least)
    gains, order = np.zeros(len(candidates)), _neighbours_together(candidates)
    of_a, met = witnesses(a), list[Crossing]()
    for j, alone in b.seen.items():
        live = order[gains[order] >= least]
        for first in range(0, len(live), _CANDIDATES_AT_ONCE):
            some = live[first : first + _CANDIDATES_AT_ONCE]
            crossed = crossing_one(of_a, j, b.poses[j], candidates, some, scans)
            if crossed is not None:
                together = _seen_by_all(alone, crossed, scans, settings)
                gains[crossed.numbers] += _gain(together, alone, scans[j], settings)
                met.append(crossed)
    kept = gains >= least
    gains[~kept] = -math.inf
    rows = np.cumsum(kept) - 1
    seen_of_a: dict[StationId, Seen] = {}
    for crossed in (left for each in met if (left := each.at(kept)) is not None):
        for i, numbers, said in _said_of_first(crossed, scans, settings):
            if i not in seen_of_a:
                seen_of_a[i] = _repeated(a.seen[i], int(kept.sum()))
            _add(seen_of_a[i], rows[numbers], said)
    for i, together in seen_of_a.items():
        gains[kept] += _gain(together, a.seen[i], scans[i], settings)
    return gains


def _neighbours_together(candidates: FloatArray) -> NDArray[np.intp]:
    """(K,) numbers of candidates a_T_b (K, 3): those that bring the blocks together alike follow each other.

    The same stations are then witnesses of all, and those of far away are not asked in vain.
    """
    x, y, theta = candidates.T
    return np.lexsort((y, np.round(x / _ALIKE_M), np.round(theta / _ALIKE_RAD)))


def _gain(together: Seen, alone: Seen, scan: ScanIndex, settings: MatchingSettings) -> FloatArray:
    """(M,) what new witnesses add to the evidence of one scan's walls."""
    lengths = lengths_of(scan)
    return evidence_of(together, lengths, settings) - evidence_of(alone, lengths, settings)


def said_of_second(
    crossed: Crossing, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> PointEvidence:
    """What each of its L witnesses says of the N points of the station at the M candidates, (L, M, N)."""
    both = crossed.lanes(scans)
    said = point_evidence(both, both, crossed.i_T_j, settings, STRIDE)
    count = len(scans[crossed.j].lengths[::STRIDE])
    return PointEvidence(said.hit[..., :count], said.seen_through[..., :count])


def _seen_by_all(
    alone: Seen,
    crossed: Crossing,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> Seen:
    """What is seen of the station's points (M, N) by those of its own block and by its witnesses together."""
    said = said_of_second(crossed, scans, settings)
    return Seen(
        alone.hits + said.hit.sum(axis=0),
        np.maximum(alone.best, said.hit.max(axis=0)),
        alone.through + said.seen_through.sum(axis=0),
    )


def _said_of_first(
    crossed: Crossing, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> Iterator[tuple[StationId, NDArray[np.intp], PointEvidence]]:
    """What the station says of the points of each of its witnesses, and at which candidates (M,)."""
    both = crossed.lanes_back(scans)
    said = point_evidence(both, both, invert(crossed.i_T_j), settings, STRIDE)
    for i, hit, through in zip(crossed.witnesses, said.hit, said.seen_through, strict=True):
        count = len(scans[i].lengths[::STRIDE])
        yield i, crossed.numbers, PointEvidence(hit[:, :count], through[:, :count])


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
    for crossed in crossing(a, b, a_T_b[None], scans):
        seen[crossed.j] = _seen_by_all(seen[crossed.j], crossed, scans, settings)
        for i, numbers, said in _said_of_first(crossed, scans, settings):
            _add(seen[i], numbers, said)
    moved = {station: pose @ place for station, place in b.poses.items()}
    groups = tuple(frozenset(part.poses) for part in (a, b) if len(part.poses) > 1)
    return Block(
        {**a.poses, **moved},
        {s: Seen(v.hits[0], v.best[0], v.through[0]) for s, v in seen.items()},
        a.sights + b.sights,
        (*a.parts, *b.parts, *groups),
    )
