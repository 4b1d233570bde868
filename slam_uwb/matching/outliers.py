"""Used matches that the others deny: a pair that overlaps little may fit some centimetres beside its place."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.survey import StationId
from .agreement import placed
from .spanning import largest_group

_ALLOWED = np.array([0.04, 0.04, 0.0125])  # m, m, rad; nearer, no wall tells the one from the other
_SIGMAS = 1.0  # nor is a match beside its place where it says itself that it may be


def worst_outliers(
    matches: Sequence[ScanMatch],
    placement: Mapping[StationId, Pose2],
    decided: Collection[frozenset[StationId]] = (),
) -> frozenset[frozenset[StationId]]:
    """Pairs whose match is beside the placement by more than any other at their two stations.

    The others may be beside for no fault of theirs: look again when the placement no longer rests on
    the worst. None that somebody has decided on, and none whose loss would leave a station alone.
    """
    open_ = [match for match in matches if match.ends not in decided]
    misfits = [(_misfit(match, placement), match.ends) for match in open_]
    found: set[frozenset[StationId]] = set()
    touched: set[StationId] = set()
    for misfit, ends in sorted(misfits, key=lambda row: -row[0]):
        if misfit <= 1.0:
            break
        if ends & touched:
            continue
        kept = [match for match in matches if match.ends not in {*found, ends}]
        if len(largest_group(placement, kept)) == len(placement):
            found.add(ends)
            touched |= ends
    return frozenset(found)


def _misfit(match: ScanMatch, placement: Mapping[StationId, Pose2]) -> float:
    """How far a match is beside a placement that has both its stations; above 1 is too far."""
    there = placed(match.target, match.source, placement)
    if there is None:
        return 0.0
    beside = match.target_T_source.inverse() @ there
    values, axes = np.linalg.eigh(match.covariance[:2, :2])
    off = np.abs([*(axes.T @ beside.translation), beside.theta])
    sigmas = np.sqrt(np.maximum([*values, match.covariance[2, 2]], 0.0))
    return float((off / np.maximum(_ALLOWED, _SIGMAS * sigmas)).max())
