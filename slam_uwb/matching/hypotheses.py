"""Pairs of scans -> hypotheses of how they lie to each other, each with covariance and evidence."""

from __future__ import annotations

from collections.abc import Callable

from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from .batch import distinct
from .correlative import correlative_matches
from .covariance import match_covariance
from .index import ScanIndex
from .landmark import closest_point_count, landmark_matches
from .refiners import REFINERS
from .score import score_matches

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
