"""Pairs of scans -> hypotheses of how they lie to each other, each with covariance and evidence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from .batch import distinct
from .correlative import correlative_matches
from .covariance import match_covariances
from .index import ScanIndex
from .landmark import closest_point_count, landmark_matches
from .lanes import ScanPair
from .refiners import refine_pairs
from .score import Scores, score_pairs

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
    (found,) = match_together([(target, source)], settings)
    return found


def match_together(
    pairs: Sequence[ScanPair], settings: MatchingSettings
) -> list[tuple[ScanMatch, ...]]:
    """The same of Q pairs, at once where that saves time; what is found does not depend on the others."""
    initialise = INITIALISERS[settings.initialiser]
    initial = [initialise(target, source, settings) for target, source in pairs]
    refined = [
        refinement.poses[refinement.converged]
        for refinement in refine_pairs(pairs, initial, settings)
    ]
    each = [pair for pair, poses in zip(pairs, refined, strict=True) for _ in poses]
    scores = iter(score_pairs(each, np.concatenate(refined)[:, None], settings))
    return [
        _best(*pair, poses, Scores.joined([next(scores) for _ in poses]), settings)
        for pair, poses in zip(pairs, refined, strict=True)
    ]


def _best(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    scores: Scores,
    settings: MatchingSettings,
) -> tuple[ScanMatch, ...]:
    """The matches worth keeping at poses target_T_source (K, 3) that have these scores, the best first."""
    if not len(poses):
        return ()
    if settings.ranking == "evidence":
        worth = np.flatnonzero(scores.evidence >= settings.min_evidence_m)
        poses, scores = poses[worth], scores.of(worth)
        order = scores.evidence
    else:
        order = closest_point_count(target, source, poses, settings.closest_point_m)
    best = np.array(distinct(poses, order, settings.hypotheses), dtype=np.intp)
    return _described(target, source, poses[best], scores.of(best), settings)


def describe_match(
    target: ScanIndex, source: ScanIndex, pose: FloatArray, rank: int, settings: MatchingSettings
) -> ScanMatch:
    """The match at pose target_T_source (3,) with its covariance, overlap, violation and evidence."""
    (match,) = describe_pairs([(target, source)], pose[None], settings)
    return replace(match, rank=rank)


def describe_pairs(
    pairs: Sequence[ScanPair], poses: FloatArray, settings: MatchingSettings
) -> tuple[ScanMatch, ...]:
    """The matches of Q pairs, each at its pose target_T_source (Q, 3)."""
    scores = score_pairs(pairs, poses[:, None], settings)
    return tuple(
        _described(target, source, pose[None], score, settings)[0]
        for (target, source), pose, score in zip(pairs, poses, scores, strict=True)
    )


def _described(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    scores: Scores,
    settings: MatchingSettings,
) -> tuple[ScanMatch, ...]:
    """The matches at poses target_T_source (K, 3) that have these scores, in their order."""
    covariances = match_covariances(target, source, poses, settings)
    return tuple(
        ScanMatch(
            target=target.scan.station,
            source=source.scan.station,
            target_T_source=Pose2.from_vector(pose),
            covariance=covariance,
            overlap=float(scores.confirmed[rank] / scores.total),
            violation=float(scores.through[rank] / scores.total),
            score=float(scores.evidence[rank]),
            rank=rank,
            degenerate=degenerate,
        )
        for rank, (pose, (covariance, degenerate)) in enumerate(
            zip(poses, covariances, strict=True)
        )
    )
