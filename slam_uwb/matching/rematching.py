"""Pairs matched once more from where a placement of all the stations has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TypeVar

import numpy as np

from ..model.geometry import Pose2
from ..model.products import Kept, ScanMatch, Share, alone
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .agreement import placed, same_place
from .hypotheses import describe_pairs
from .index import ScanIndex
from .lanes import shared_parts
from .refiners.point_to_line import polish_pairs
from .score import score_pairs
from .sight import Sights, may_meet
from .slack import with_slack

_NEARLY = 0.8  # refining may add so much to the overlap
_GLANCE = 3  # every third point is enough to see whether a pair overlaps
_FREE_SIGMA = 0.05  # m and rad; a wall holds to centimetres or not at all
_SAME_BASIN_RAD = 0.1  # a match that turns further has left the placement


@dataclass(frozen=True, slots=True)
class _Glance:
    """A pair at the placement, before it is refined."""

    target: StationId
    source: StationId
    start: Pose2
    """target_T_source."""
    overlap: float


_Pair = TypeVar("_Pair", ScanMatch, _Glance)


def rematch_pairs(
    scans: Mapping[StationId, ScanIndex],
    placement: Mapping[StationId, Pose2],
    pairs: Sequence[tuple[StationId, StationId]],
    settings: MatchingSettings,
    *,
    firm: Sequence[ScanMatch] = (),
    until_still: bool = False,
    share: Share = alone,
) -> tuple[ScanMatch, ...]:
    """Matches of the pairs that overlap at a placement, refined once more from there.

    A pair whose match leaves the placement by more than the fine gate, or that confirms less than
    `min_evidence_m` of wall, says nothing. Pairs with less overlap than `min_overlap` are weaker
    than what their neighbours bring: they are used only where no other pair joins their stations.
    Of a pair that has none, or that is not to be matched again, a `firm` match is taken as it is.
    """
    again = {frozenset(pair) for pair in pairs}
    joined = [match for match in firm if match.ends not in again]
    glances = _glances(scans, placement, pairs, settings)
    chosen = _strong_or_joining(glances, _NEARLY * settings.min_overlap, joined)
    refine = partial(_refined, share.keep(scans), settings, until_still)
    parts = [chosen[part] for part in shared_parts(len(chosen))]
    matches = tuple(chain.from_iterable(share(refine, parts)))
    return with_firm(_strong_or_joining(matches, settings.min_overlap, joined), firm, placement)


def _glances(
    scans: Mapping[StationId, ScanIndex],
    placement: Mapping[StationId, Pose2],
    pairs: Sequence[tuple[StationId, StationId]],
    settings: MatchingSettings,
) -> tuple[_Glance, ...]:
    """The pairs at their places that have enough wall in common."""
    met = [
        (target, source, start)
        for target, source in pairs
        if (start := placed(target, source, placement)) is not None
        if may_meet(
            Sights.of([scans[target].sight]), scans[source].sight, start.vector[None, None]
        ).any()
    ]
    poses = np.array([start.vector for *_, start in met]).reshape(-1, 1, 3)
    both = [(scans[target], scans[source]) for target, source, _ in met]
    return tuple(
        _Glance(*pair, float(scores.confirmed[0]) / scores.total)
        for pair, scores in zip(met, score_pairs(both, poses, settings, _GLANCE), strict=True)
        if scores.confirmed[0] >= settings.min_evidence_m
    )


def _refined(
    scans: Kept[Mapping[StationId, ScanIndex]],
    settings: MatchingSettings,
    until_still: bool,
    glances: Sequence[_Glance],
) -> tuple[ScanMatch, ...]:
    """The matches of the pairs that have one with evidence near their place."""
    starts = np.array([glance.start.vector for glance in glances]).reshape(-1, 3)
    both = [(scans.value[glance.target], scans.value[glance.source]) for glance in glances]
    refined = polish_pairs(both, starts, settings, until_still=until_still)
    settled = [int(number) for number in np.flatnonzero(refined.converged)]
    both = [both[number] for number in settled]
    matches = describe_pairs(both, refined.poses[settled], settings)
    matches = with_slack(matches, both, settings)
    found = []
    for number, match in zip(settled, matches, strict=True):
        start = glances[number].start
        left = leave_free_directions(match, start)
        stayed = same_place(left.target_T_source, start, settings.fine_gate_m, _SAME_BASIN_RAD)
        if stayed and left.score >= settings.min_evidence_m:
            found.append(left)
    return tuple(found)


def leave_free_directions(match: ScanMatch, start: Pose2) -> ScanMatch:
    """The match with its pose as at `start` (target_T_source) in the directions that its walls leave free.

    There the refiner follows whatever clutter happens to pair; all the other pairs that made the
    placement know better (solution remapping, Zhang, Kaess and Singh 2016).
    """
    values, axes = np.linalg.eigh(match.covariance)
    held = axes[:, values < _FREE_SIGMA**2]
    step = (start.inverse() @ match.target_T_source).vector
    return replace(match, target_T_source=start @ Pose2.from_vector(held @ (held.T @ step)))


def _strong_or_joining(
    matches: Sequence[_Pair], min_overlap: float, joined: Sequence[ScanMatch]
) -> tuple[_Pair, ...]:
    """All matches with enough overlap, and of the others those that join groups, the best first.

    `joined` matches are used anyway: what they join needs no other.
    """
    group: dict[StationId, int] = {}
    used = set()
    rows: list[tuple[int, _Pair | ScanMatch]] = [(-1, match) for match in joined]
    rows += sorted(enumerate(matches), key=lambda row: -row[1].overlap)
    for index, match in rows:
        a = group.setdefault(match.target, len(group))
        b = group.setdefault(match.source, len(group))
        if index < 0 or match.overlap >= min_overlap or a != b:
            used.add(index)
            group = {station: a if label == b else label for station, label in group.items()}
    return tuple(match for index, match in enumerate(matches) if index in used)


def within(
    stations: Mapping[StationId, object], matches: Sequence[ScanMatch]
) -> tuple[ScanMatch, ...]:
    """The matches both of whose stations are among these."""
    return tuple(match for match in matches if match.ends <= stations.keys())


def with_firm(
    matches: Sequence[ScanMatch],
    firm: Sequence[ScanMatch],
    stations: Mapping[StationId, object],
) -> tuple[ScanMatch, ...]:
    """The matches, and the firm ones between these stations whose pair is not among them."""
    there = {match.ends for match in matches}
    missing = [match for match in within(stations, firm) if match.ends not in there]
    return (*matches, *(replace(match, rejection=None) for match in missing))
