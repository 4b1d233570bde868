"""Stations alone: move a placement to where its scan matches agree best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import gtsam
from gtsam.symbol_shorthand import X

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.survey import StationId

_CAUCHY_SIGMAS = (
    2.0  # a pair that disagrees with its neighbours loses weight instead of bending the map
)


def adjust_placement(
    placement: Mapping[StationId, Pose2], matches: Sequence[ScanMatch]
) -> dict[StationId, Pose2]:
    """Least squares over all matches with a Cauchy loss, by Levenberg-Marquardt; the first station stays.

    Stations without a match keep their place.
    """
    graph = gtsam.NonlinearFactorGraph()
    start = gtsam.Values()
    number = {station: index for index, station in enumerate(placement)}
    for station, pose in placement.items():
        start.insert(X(number[station]), gtsam.Pose2(pose.x, pose.y, pose.theta))
    touched = {station for match in matches for station in (match.target, match.source)}
    # Hold what nothing else holds: the first station, and stations without any match.
    firm = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
    for station, pose in placement.items():
        if number[station] == 0 or station not in touched:
            graph.addPriorPose2(X(number[station]), gtsam.Pose2(pose.x, pose.y, pose.theta), firm)
    loss = gtsam.noiseModel.mEstimator.Cauchy.Create(_CAUCHY_SIGMAS)
    for match in matches:
        relative = match.target_T_source
        noise = gtsam.noiseModel.Robust.Create(
            loss, gtsam.noiseModel.Gaussian.Covariance(match.covariance)
        )
        graph.add(
            gtsam.BetweenFactorPose2(
                X(number[match.target]),
                X(number[match.source]),
                gtsam.Pose2(relative.x, relative.y, relative.theta),
                noise,
            )
        )
    result = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    poses = {station: result.atPose2(X(index)) for station, index in number.items()}
    return {station: Pose2(pose.x(), pose.y(), pose.theta()) for station, pose in poses.items()}
