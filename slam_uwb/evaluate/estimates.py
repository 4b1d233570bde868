"""Stations and anchors seen as one kind of thing: a place with a covariance in the world's axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Pose2, Vector2
from ..model.solution import AnchorEstimate, Solution, StationEstimate, Status


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """One station or anchor of a solution."""

    id: str
    status: Status
    position: Vector2 | None
    """(2,) m, world."""
    heading: float
    """rad, world; NaN for an anchor and for a station whose heading is not known."""
    covariance: FloatArray | None
    """World's axes: (2, 2), or (3, 3) in the order x, y, heading where the heading is known."""
    alternatives: tuple[Vector2, ...] = ()
    """(2,) m, world: other places that the data do not exclude."""


def station_estimates(solution: Solution) -> list[Estimate]:
    """The stations, in the solution's order."""
    found = []
    for item in solution.stations:
        position = None if item.pose is None else item.pose.translation
        known = item.pose is not None and item.heading_known
        heading = item.pose.theta if item.pose is not None and known else math.nan
        covariance = None
        if item.pose is not None and item.covariance is not None:
            axes = _world_axes(item.pose)
            size = 3 if known else 2
            covariance = (axes @ item.covariance @ axes.T)[:size, :size]
        found.append(
            Estimate(item.id, item.status, position, heading, covariance, _alternatives(item))
        )
    return found


def anchor_estimates(solution: Solution) -> list[Estimate]:
    """The anchors, in the solution's order."""
    return [
        Estimate(
            item.id, item.status, item.position, math.nan, item.covariance, _alternatives(item)
        )
        for item in solution.anchors
    ]


def _alternatives(item: StationEstimate | AnchorEstimate) -> tuple[Vector2, ...]:
    return tuple(np.array([other.x, other.y]) for other in item.alternatives)


def joint_covariance(solution: Solution) -> FloatArray:
    """(3 (S + A), 3 (S + A)) in the world's axes, three rows each, stations then anchors as listed.

    What the solution's joint covariance does not hold is zero; so is the third row of an anchor.
    """
    count = len(solution.stations) + len(solution.anchors)
    full = np.zeros((3 * count, 3 * count))
    if solution.joint_covariance is None or not solution.joint_names:
        return full
    # 3 rows a station, 2 an anchor: the number of rows tells where the anchors begin, whose names
    # may be those of stations.
    names = solution.joint_names
    split = len(solution.joint_covariance) - 2 * len(names)
    stations = {str(item.id): k for k, item in enumerate(solution.stations)}
    anchors = {str(item.id): k + len(stations) for k, item in enumerate(solution.anchors)}
    rows: list[int] = []
    turn = np.eye(len(solution.joint_covariance))
    for k, name in enumerate(names):
        place = stations[name] if k < split else anchors[name]
        if k < split and (pose := solution.stations[place].pose) is not None:
            turn[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = _world_axes(pose)
        rows += range(3 * place, 3 * place + (3 if k < split else 2))
    full[np.ix_(rows, rows)] = turn @ solution.joint_covariance @ turn.T
    return full


def _world_axes(pose: Pose2) -> FloatArray:
    """(3, 3) turns (x, y, heading) of the station's axes into the world's."""
    axes = np.eye(3)
    axes[:2, :2] = pose.rotation
    return axes
