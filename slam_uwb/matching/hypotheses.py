"""Pairs of scans -> hypotheses of how they lie to each other, each with covariance and evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import distinct
from .correlative import correlative_matches
from .covariance import match_covariance
from .index import ScanIndex, within_sight
from .landmark import closest_point_count, landmark_matches
from .refiners import REFINERS
from .refiners.point_to_line import polish
from .score import score_matches

_NEARLY = 0.8  # refining may add so much to the overlap
_FREE_SIGMA = 0.05  # m and rad; a wall holds to centimetres or not at all
_SAME_BASIN_RAD = 0.1  # a match that turns further has left the placement

Initialiser = Callable[[ScanIndex, ScanIndex, MatchingSettings], FloatArray]

INITIALISERS: dict[str, Initialiser] = {
    "correlative": correlative_matches,
    "landmark": landmark_matches,
}


def match_pair(
    target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> tuple[ScanMatch, ...]:
    """Hypotheses target_T_source of one pair, the best first; none where nothing fits.

    Initial matches are refined, those that end in one place count once, and the rest is ranked by
    the evidence of walls confirmed and looked through (or, as the paper does, by the number of
    points with a close partner).
    """
    initial = INITIALISERS[settings.initialiser](target, source, settings)
    if not len(initial):
        return ()
    refined = REFINERS[settings.refiner](target, source, initial, settings)
    poses = refined.poses[refined.converged]
    if not len(poses):
        return ()
    if settings.ranking == "evidence":
        order = score_matches(target, source, poses, settings).evidence
        worth = order >= settings.min_evidence_m
        poses, order = poses[worth], order[worth]
    else:
        order = closest_point_count(target, source, poses, settings.closest_point_m)
    best = distinct(poses, order, settings.hypotheses)
    return tuple(
        describe_match(target, source, poses[index], rank, settings)
        for rank, index in enumerate(best)
    )


def describe_match(
    target: ScanIndex, source: ScanIndex, pose: FloatArray, rank: int, settings: MatchingSettings
) -> ScanMatch:
    """The match at pose target_T_source (3,) with its covariance, overlap, violation and evidence."""
    target_T_source = Pose2.from_vector(pose)
    scores = score_matches(target, source, pose[None, :], settings)
    covariance, degenerate = match_covariance(target, source, target_T_source, settings)
    return ScanMatch(
        target=target.scan.station,
        source=source.scan.station,
        target_T_source=target_T_source,
        covariance=covariance,
        overlap=float(scores.confirmed[0] / scores.total),
        violation=float(scores.through[0] / scores.total),
        score=float(scores.evidence[0]),
        rank=rank,
        degenerate=degenerate,
    )


def rematch_pairs(
    scans: Mapping[StationId, ScanIndex],
    placement: Mapping[StationId, Pose2],
    pairs: Sequence[tuple[StationId, StationId]],
    settings: MatchingSettings,
    *,
    until_still: bool = False,
) -> tuple[ScanMatch, ...]:
    """Matches of the pairs that overlap at a placement, refined once more from there.

    A pair whose match leaves the placement by more than the fine gate, or that confirms less than
    `min_evidence_m` of wall, says nothing. Pairs with less overlap than `min_overlap` are weaker
    than what their neighbours bring: they are used only where no other pair joins their stations.
    """
    glances = [
        _Glance(target, source, start, float(scores.confirmed[0]) / scores.total)
        for target, source in pairs
        if target in placement and source in placement
        for start in [placement[target].inverse() @ placement[source]]
        if within_sight(scans[target], scans[source], math.hypot(start.x, start.y))
        for scores in [
            score_matches(scans[target], scans[source], start.vector[None, :], settings, 3)
        ]
        if scores.confirmed[0] >= settings.min_evidence_m
    ]
    matches = []
    for glance in _strong_or_joining(glances, _NEARLY * settings.min_overlap):
        target, source, start = glance.target, glance.source, glance.start
        refined = polish(
            scans[target],
            scans[source],
            start.vector[None, :],
            settings,
            until_still=until_still,
        )
        match = describe_match(scans[target], scans[source], refined.poses[0], 0, settings)
        match = leave_free_directions(match, start)
        stayed = (
            match.target_T_source.distance_to(start) < settings.fine_gate_m
            and match.target_T_source.angle_to(start) < _SAME_BASIN_RAD
        )
        if refined.converged[0] and stayed and match.score >= settings.min_evidence_m:
            matches.append(match)
    return _strong_or_joining(matches, settings.min_overlap)


@dataclass(frozen=True, slots=True)
class _Glance:
    """A pair at the placement, before it is refined."""

    target: StationId
    source: StationId
    start: Pose2
    """target_T_source."""
    overlap: float


def leave_free_directions(match: ScanMatch, start: Pose2) -> ScanMatch:
    """The match with its pose as at `start` (target_T_source) in the directions that its walls leave free.

    There the refiner follows whatever clutter happens to pair; all the other pairs that made the
    placement know better (solution remapping, Zhang, Kaess and Singh 2016).
    """
    values, axes = np.linalg.eigh(match.covariance)
    held = axes[:, values < _FREE_SIGMA**2]
    step = (start.inverse() @ match.target_T_source).vector
    return replace(match, target_T_source=start @ Pose2.from_vector(held @ (held.T @ step)))


_Pair = TypeVar("_Pair", ScanMatch, _Glance)


def _strong_or_joining(matches: Sequence[_Pair], min_overlap: float) -> tuple[_Pair, ...]:
    """All matches with enough overlap, and of the others those that join groups, the best first."""
    group: dict[StationId, int] = {}
    used = set()
    for index in sorted(range(len(matches)), key=lambda i: -matches[i].overlap):
        match = matches[index]
        a = group.setdefault(match.target, len(group))
        b = group.setdefault(match.source, len(group))
        if match.overlap >= min_overlap or a != b:
            used.add(index)
            group = {station: a if label == b else label for station, label in group.items()}
    return tuple(match for index, match in enumerate(matches) if index in used)
