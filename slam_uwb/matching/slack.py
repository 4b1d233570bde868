"""A direction in which the walls of two scans tell no place from its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from .batch import compose
from .lanes import ScanPair
from .score import score_pairs

_STEP_M = 0.15  # far enough that no wall that was met is met still
_TOLD_M = 0.25  # of wall that such a step must cost: the jambs of a door, seen from either side
_SLACK_M = 0.3  # sigma of a direction in which it costs less


def with_slack(
    matches: Sequence[ScanMatch], pairs: Sequence[ScanPair], settings: MatchingSettings
) -> tuple[ScanMatch, ...]:
    """The matches of these pairs; where a step along its least held direction costs no evidence, that has slack.

    The covariance speaks of the partners that the refiner has chosen. Seen through a door, a few
    points can choose wrong ones a hand's breadth away and hold that place as firmly as the right one;
    that neither place shows more wall than the other gives them away.
    """
    steps = _STEP_M * np.array([_least_held(match) for match in matches]).reshape(-1, 1, 2)
    places = np.array([match.target_T_source.vector for match in matches]).reshape(-1, 1, 3)
    beside = np.concatenate([-steps, steps], axis=1)
    poses = compose(places, np.concatenate([beside, np.zeros((len(matches), 2, 1))], axis=2))
    scores = score_pairs(pairs, poses, settings)
    return tuple(
        match
        if match.degenerate or match.score - float(score.evidence.max()) >= _TOLD_M
        else _slackened(match)
        for match, score in zip(matches, scores, strict=True)
    )


def _least_held(match: ScanMatch) -> FloatArray:
    """(2,) the direction in the source's axes in which the match is least sure."""
    return np.asarray(np.linalg.eigh(match.covariance[:2, :2])[1][:, 1])


def _slackened(match: ScanMatch) -> ScanMatch:
    covariance = match.covariance.copy()
    axis = _least_held(match)
    covariance[:2, :2] += _SLACK_M**2 * np.outer(axis, axis)
    return replace(match, covariance=covariance, degenerate=True)
