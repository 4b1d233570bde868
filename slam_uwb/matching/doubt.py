"""Stations that fit at several places, named so in what the solvers made of the others."""

from __future__ import annotations

from dataclasses import replace

from ..model.errors import DisconnectedSurveyError
from ..model.geometry import Pose2
from ..model.solution import Alternative, GraphEstimate, StationEstimate, Status
from .selection import Selection


def name_ambiguous(estimate: GraphEstimate, selection: Selection) -> GraphEstimate:
    """The estimate with the ambiguous stations that it has no place for named so, and their places."""
    shared = [
        pose @ selection.placement[station].inverse()
        for station, pose in estimate.poses.items()
        if station in selection.placement
    ]
    if not shared:
        return estimate
    stations = tuple(
        _ambiguous(station, selection.ambiguous[station.id], shared[0])
        if station.id in selection.ambiguous and station.pose is None
        else station
        for station in estimate.stations
    )
    return replace(estimate, stations=stations)


def repeating_building(selection: Selection) -> DisconnectedSurveyError:
    """Why nothing is left to be solved: the ambiguous stations."""
    names = ", ".join(selection.ambiguous)
    return DisconnectedSurveyError(
        f"every station fits at more than one place ({names}): the building repeats itself; "
        "ranges to anchors or a surveyed station would tell"
    )


def _ambiguous(
    station: StationEstimate, places: tuple[tuple[Pose2, float], ...], world_T_placement: Pose2
) -> StationEstimate:
    poses = [(world_T_placement @ pose, weight) for pose, weight in places]
    alternatives = tuple(Alternative(p.x, p.y, p.theta, weight) for p, weight in poses)
    return replace(station, status=Status.AMBIGUOUS, alternatives=alternatives)
