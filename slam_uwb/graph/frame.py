"""Which stations are solved, from where, and in which frame.

The frame is the site's where at least two control points, or one with yaw, fix it; else that of the
first placed station.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..model.errors import DisconnectedSurveyError
from ..model.geometry import FloatArray, Matrix3, Points, Pose2, Vector2
from ..model.products import GraphProblem
from ..model.survey import AnchorId, KnownPlace, StationId
from .chain import held_together

SITE = "site"

MIN_BASELINE = 0.05
"""m. Control points closer than this do not give a direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """The stations that are solved, where they start, and what their frame is."""

    frame: str
    """`site`, or the station whose frame it is."""
    poses: dict[StationId, Pose2]
    """frame_T_station, in the survey's order."""
    group: frozenset[StationId]
    """Those that matches hold together."""
    headings: frozenset[StationId]
    """Those whose heading something measures."""
    gauge: StationId | None
    """The station that is held where nothing else holds the frame: while no anchor is placed, if
    anchors are what fixes the site."""

    @property
    def in_site(self) -> bool:
        """Whether known places hold in this frame."""
        return self.frame == SITE


def choose_start(problem: GraphProblem) -> Start:
    """Stations to solve and their start, in the site's frame where stations alone fix it.

    The matched group is moved rigidly onto its control points. Where it has too few, the larger of
    the group and the stations with known places is solved; `tie_to_site` may bring both together.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
    """
    group = _group(problem)
    site_T_group = _fit(_station_controls(problem, group))
    if group and site_T_group is not None:
        return _site_start(problem, {name: site_T_group @ pose for name, pose in group.items()})
    known = [station for station in problem.stations if station.known is not None]
    site_points = len(known) + sum(anchor.known is not None for anchor in problem.anchors)
    has_yaw = any(station.known.theta is not None for station in known if station.known)
    loose = sum(station.id not in group for station in known)
    if group and not (site_points >= 2 and loose >= len(group)):
        first = next(iter(group))
        return Start(first, group, frozenset(group), frozenset(group), gauge=first)
    if site_points >= 2 or has_yaw:
        return _site_start(problem, {})
    raise DisconnectedSurveyError(
        "no two stations hold together and no two control points (or one with yaw) fix a site frame"
    )


def tie_to_site(
    problem: GraphProblem,
    start: Start,
    located: Mapping[StationId, Pose2],
    anchors: Mapping[AnchorId, FloatArray],
) -> Start | None:
    """The start moved onto the site by what ranges found, or None where that does not fix it.

    Args:
        problem: holds the known places.
        start: solved poses in a station's frame.
        located: poses in the same frame of stations found by their ranges, headings unknown.
        anchors: (2,) places in the same frame, of those that were determined.
    """
    if start.in_site:
        return None
    controls = _station_controls(problem, {**located, **start.poses}) + [
        (Pose2(float(place[0]), float(place[1]), 0.0), anchor.known)
        for anchor in problem.anchors
        if anchor.known is not None and (place := anchors.get(anchor.id)) is not None
    ]
    # One station with yaw would have fixed the frame before: two places are needed here.
    site_T_station = _fit(controls) if len(controls) >= 2 else None
    if site_T_station is None:
        return None
    poses = {name: site_T_station @ pose for name, pose in start.poses.items()}
    return replace(_site_start(problem, poses), gauge=start.gauge)


def rigid_fit(source: Points, target: Points) -> Pose2:
    """target_T_source of least squares, without scale or reflection (Umeyama 1991, c = 1).

    Args:
        source: (N, 2) points, N >= 2 and not all in one place.
        target: (N, 2) where they are to lie.
    """
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - source_mean, target - target_mean
    theta = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    turned = Pose2(0.0, 0.0, theta).transform(source_mean)
    x, y = target_mean - turned
    return Pose2(float(x), float(y), theta)


def alignment_covariance(
    start: Start, root: StationId, controls: list[tuple[Vector2, KnownPlace]]
) -> Matrix3:
    """(3, 3) of the pose of `root`, in its own axes, after a rigid fit onto control points.

    Args:
        start: poses in the site's frame.
        root: the station that carries the others.
        controls: (2,) m, where the fit has each control point, and how well that is known.
    """
    pose = start.poses[root]
    # A direction without a control point stays uncertain by 100 m and half a turn.
    information = np.diag([1e-4, 1e-4, np.pi**-2])
    for place, known in controls:
        # Where the root moves by (x, y, theta) in its own axes, a point fixed to it moves with it.
        arm = pose.inverse().transform(place)
        moves = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
        information += moves.T @ moves / known.sigma**2
        if known.theta is not None:
            information[2, 2] += known.sigma_theta**-2
    return np.asarray(np.linalg.inv(information))


def _group(problem: GraphProblem) -> dict[StationId, Pose2]:
    """The stations that hold together, in the frame of the first of them."""
    names = held_together(problem)
    if not names:
        return {}
    first_T_frame = problem.placement[names[0]].inverse()
    return {name: first_T_frame @ problem.placement[name] for name in names}


def _station_controls(
    problem: GraphProblem, poses: Mapping[StationId, Pose2]
) -> list[tuple[Pose2, KnownPlace]]:
    return [
        (poses[station.id], station.known)
        for station in problem.stations
        if station.known is not None and station.id in poses
    ]


def _fit(controls: list[tuple[Pose2, KnownPlace]]) -> Pose2 | None:
    """site_T_frame by the control points, or None where they do not fix it."""
    source = np.array([[pose.x, pose.y] for pose, _ in controls]).reshape(-1, 2)
    target = np.array([[known.x, known.y] for _, known in controls]).reshape(-1, 2)
    if len(target) >= 2 and np.ptp(target, axis=0).max() > MIN_BASELINE:
        return rigid_fit(source, target)
    for pose, known in controls:
        if known.theta is not None:
            return Pose2(known.x, known.y, known.theta) @ pose.inverse()
    return None


def _site_start(problem: GraphProblem, group: Mapping[StationId, Pose2]) -> Start:
    """The group, already in the site's frame, with the known stations outside it."""
    poses: dict[StationId, Pose2] = {}
    headings: set[StationId] = set()
    for station in problem.stations:
        known = station.known
        if station.id in group:
            poses[station.id] = group[station.id]
        elif known is not None:
            poses[station.id] = Pose2(known.x, known.y, known.theta or 0.0)
        if station.id in group or (known is not None and known.theta is not None):
            headings.add(station.id)
    return Start(SITE, poses, frozenset(group), frozenset(headings), gauge=None)
