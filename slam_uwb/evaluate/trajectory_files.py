"""Station poses as TUM trajectories, which `evo` and other tools of SLAM read.

The format (Sturm et al., IROS 2012) has a time stamp and a pose in space on each line. Stations have
no order that matters: the time stamp is the station's number, the same in both files, so that tools
pair them by it. The plane is z = 0 and a heading is a turn about z.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import Pose2
from ..model.solution import Solution, Status
from ..model.survey import Reference


def estimate_to_tum(solution: Solution, *, only_ok: bool = True) -> str:
    """world_T_station of the stations whose pose is known, one line each, in the solution's order.

    Args:
        solution: Where the stations were found.
        only_ok: Leave out what the solution itself does not trust.
    """
    lines = [
        _line(number, station.pose)
        for number, station in enumerate(solution.stations)
        if station.pose is not None
        and station.heading_known
        and (station.status is Status.OK or not only_ok)
    ]
    return "".join(lines)


def reference_to_tum(solution: Solution, reference: Reference) -> str:
    """True poses of the solution's stations with their numbers, as far as the reference knows them."""
    lines = []
    for number, station in enumerate(solution.stations):
        place = reference.stations.get(station.id)
        if place is not None and np.isfinite([place.x, place.y, place.theta]).all():
            lines.append(_line(number, Pose2(place.x, place.y, place.theta)))
    return "".join(lines)


def _line(number: int, pose: Pose2) -> str:
    """`timestamp tx ty tz qx qy qz qw`."""
    sine, cosine = math.sin(pose.theta / 2.0), math.cos(pose.theta / 2.0)
    return f"{number}.0 {pose.x:.9f} {pose.y:.9f} 0 0 0 {sine:.12f} {cosine:.12f}\n"
