"""Stations that would fit elsewhere in the finished map as well.

In a building of equal rooms a wrong place can have as much evidence as the right one. So every
station, and every group that was placed as one, is taken out of the finished block once, and put back
wherever its hypotheses allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import Kept, ScanMatch, Share, alone
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .evidence import Block, Seen, total_evidence
from .index import ScanIndex
from .merging import (
    RangeGain,
    Touching,
    aligned_gains,
    distant,
    merge_candidates,
    touching_stations,
)
from .parts import part_of, seen_by_each

_ELSEWHERE_M, _ELSEWHERE_RAD = 1.0, 0.5  # nearer places are one place, badly known
_RIVALS = 10  # places looked at, those with most support
_NEARLY_AS_GOOD = 0.6  # share of its own evidence that a station's next best place may have
_FITS_M = 4.5  # metres of wall, none denied: a place where a station could as well stand
_ALIASED = 0.75  # share of the stations that fit elsewhere from which on no place can be trusted


@dataclass(frozen=True, slots=True)
class Rival:
    """The best other place of a station in its block."""

    pose: Pose2
    """block_T_station; for a group, what moves it there from its own place."""
    evidence: float
    """m, less what the ranges prefer the station's own place by."""
    own: float
    """m, the evidence of the place where the station stands."""


@dataclass(frozen=True, slots=True, eq=False)
class _Finished:
    """A block, and what taking stations out of it asks for again and again."""

    block: Block
    seen: Mapping[StationId, Mapping[StationId, Seen]]
    touching: Touching
    evidence: float
    """m, of all of it."""


def ambiguous_stations(
    block: Block,
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
    range_gain: RangeGain,
    share: Share = alone,
) -> dict[StationId, Rival]:
    """Stations whose place in the block is not the only one, each with its best other place.

    A station is ambiguous where another place has nearly as much evidence as its own; so is a group
    of stations that were placed as one: equal rooms that were laid over each other hold each other
    wherever they stand. Where nearly all stations fit elsewhere, the building repeats itself, and all
    that do are ambiguous.
    """
    if len(block.poses) < 2:
        return {}
    single = [frozenset({station}) for station in block.poses]
    parts = [part for part in block.parts if 2 * len(part) <= len(block.poses)]
    rivals = _rivals((*single, *parts), block, scans, hypotheses, settings, range_gain, share)
    elsewhere = [g for g, r in rivals.items() if len(g) == 1 and r.evidence >= _FITS_M]
    if len(elsewhere) < _ALIASED * len(block.poses):
        elsewhere = [g for g, r in rivals.items() if r.evidence >= _NEARLY_AS_GOOD * r.own]
    return {
        station: replace(rivals[group], pose=rivals[group].pose @ block.poses[station])
        # A station's own rival is told before that of a group.
        for group in sorted(elsewhere, key=len, reverse=True)
        for station in block.poses
        if station in group
    }


def undecided_stations(
    blocks: Sequence[Block],
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
) -> int:
    """How many stations are in blocks that fit the largest one, but at several places.

    A place counts from where more speaks for it than against: weak evidence decides nothing, but that
    it is for several places tells that the rooms are alike. If they are as many as those of the largest
    block, it may be two equal rooms laid over each other as well as one.
    """
    touching = touching_stations(hypotheses)
    largest, *others = blocks
    count = 0
    for other in others:
        candidates = merge_candidates(largest, other, touching)
        candidates, gains = aligned_gains(largest, other, candidates, scans, settings)
        fits = candidates[gains > 0.0]
        if len(fits) and distant(fits, fits[0], _ELSEWHERE_M, _ELSEWHERE_RAD).any():
            count += len(other.poses)
    return count


def _rivals(
    groups: Sequence[frozenset[StationId]],
    block: Block,
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
    range_gain: RangeGain,
    share: Share,
) -> dict[frozenset[StationId], Rival]:
    """Groups of stations that fit elsewhere in the rest of the block."""
    finished = _Finished(
        block, seen_by_each(block, scans, settings), touching_stations(hypotheses),
        total_evidence(block, scans, settings),
    )  # fmt: skip
    gains_of = partial(_gains_elsewhere, share.keep(finished), share.keep(scans), settings)
    found = {}
    for group, (places, gains) in zip(groups, share(gains_of, groups), strict=True):
        allowed = gains >= settings.min_margin_m
        if not allowed[1:].any():
            continue
        allowed[0] = True
        places, gains = places[allowed], gains[allowed]
        inverse = Pose2.from_vector(places[0]).inverse()
        rest = {s: pose for s, pose in block.poses.items() if s not in group}
        part = {s: inverse @ pose for s, pose in block.poses.items() if s in group}
        # Ranges speak against a place, not for it: coarse as they are, they favour many.
        ranges = range_gain(rest, part, places)
        gains = gains + settings.range_weight_m * np.minimum(ranges - ranges[0], 0.0)
        elsewhere = np.flatnonzero(distant(places, places[0], _ELSEWHERE_M, _ELSEWHERE_RAD))
        if len(elsewhere):
            best = elsewhere[np.argmax(gains[elsewhere])]
            other_T_block = Pose2.from_vector(places[best]) @ inverse
            found[group] = Rival(other_T_block, float(gains[best]), float(gains[0]))
    return found


def _gains_elsewhere(
    finished: Kept[_Finished],
    scans: Kept[Mapping[StationId, ScanIndex]],
    settings: MatchingSettings,
    group: frozenset[StationId],
) -> tuple[FloatArray, FloatArray]:
    """Places (K, 3) of a group in the rest of its block, its own first, and their evidence (K,), m."""
    block, seen = finished.value.block, finished.value.seen
    rest = part_of(block, block.poses.keys() - group, seen)
    part = part_of(block, group, seen)
    # In its own frame: from the block's, a turn would move it far.
    pose = next(iter(part.poses.values()))
    inverse = pose.inverse()
    part = replace(part, poses={s: inverse @ place for s, place in part.poses.items()})
    others = merge_candidates(rest, part, finished.value.touching, most=_RIVALS)
    others = others[distant(others, pose.vector, _ELSEWHERE_M / 2, _ELSEWHERE_RAD / 2)]
    others, gains = aligned_gains(rest, part, others, scans.value, settings)
    without = [total_evidence(some, scans.value, settings) for some in (rest, part)]
    own = finished.value.evidence - without[0] - without[1]
    return np.vstack([pose.vector, others]), np.array([own, *gains])
