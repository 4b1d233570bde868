"""A direction in which the walls of two scans tell no place from its neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from .index import ScanIndex
from .score import score_matches

_STEP_M = 0.15  # far enough that no wall that was met is met still
_TOLD_M = 0.25  # of wall that such a step must cost: the jambs of a door, seen from either side
_SLACK_M = 0.3  # sigma of a direction in which it costs less


def with_slack(
    match: ScanMatch, target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> ScanMatch:
    """The match, its least held direction given slack if a step along it costs no evidence.

    The covariance speaks of the partners that the refiner has chosen. Seen through a door, a few
    points can choose wrong ones a hand's breadth away and hold that place as firmly as the right one;
    that neither place shows more wall than the other gives them away.
    """
    if match.degenerate:
        return match
    _, axes = np.linalg.eigh(match.covariance[:2, :2])
    axis = axes[:, 1]
    step_x, step_y = _STEP_M * axis
    poses = [
        match.target_T_source @ Pose2(sign * step_x, sign * step_y, 0.0) for sign in (-1.0, 1.0)
    ]
    beside = score_matches(target, source, np.array([pose.vector for pose in poses]), settings)
    if match.score - beside.evidence.max() >= _TOLD_M:
        return match
    covariance = match.covariance.copy()
    covariance[:2, :2] += _SLACK_M**2 * np.outer(axis, axis)
    return replace(match, covariance=covariance, degenerate=True)
