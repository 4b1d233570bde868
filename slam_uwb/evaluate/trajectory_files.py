"""Found and true poses of the stations as TUM trajectories with the same numbers."""

from __future__ import annotations

import numpy as np

from ..io.tum import poses_to_tum
from ..model.geometry import Pose2
from ..model.solution import Solution, Status
from ..model.survey import Reference


def estimate_to_tum(solution: Solution) -> str:
    """world_T_station of the stations that are ok, one line each, in the solution's order."""
    return poses_to_tum(
        {
            number: station.pose
            for number, station in enumerate(solution.stations)
            if station.pose is not None and station.heading_known and station.status is Status.OK
        }
    )


def reference_to_tum(solution: Solution, reference: Reference) -> str:
    """True poses of the solution's stations with their numbers, as far as the reference knows them."""
    poses = {}
    for number, station in enumerate(solution.stations):
        place = reference.stations.get(station.id)
        if place is not None and np.isfinite([place.x, place.y, place.theta]).all():
            poses[number] = Pose2(place.x, place.y, place.theta)
    return poses_to_tum(poses)
