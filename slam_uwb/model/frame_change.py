"""The same estimate in another frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .errors import SlamUwbError
from .floor import FloorMap
from .geometry import FloatArray, Grid, Points, Pose2, rotation_matrix
from .solution import Alternative, AnchorEstimate, GraphEstimate, StationEstimate


def change_frame(estimate: GraphEstimate, new_T_world: Pose2) -> GraphEstimate:
    """All places and covariances of an estimate as seen from another frame.

    Covariances of stations are in their own axes and stay; those of anchors turn.
    """
    return replace(
        estimate,
        stations=tuple(_station(item, new_T_world) for item in estimate.stations),
        anchors=tuple(_anchor(item, new_T_world) for item in estimate.anchors),
        joint_covariance=_joint(estimate, new_T_world.theta),
    )


_MISFIT_M = 0.25
"""Points that are further off were marked or measured wrongly; a good solution is right to centimetres."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPlan:
    """A picture of the floor with stations or anchors marked in it."""

    darkness: Grid
    """(H, W) 0-1, row 0 at the bottom; coarser than the picture where that is large."""
    pixels_a_cell: float
    height: float
    """Pixels of the picture itself."""
    points: Mapping[str, tuple[float, float]]
    """Column and row in pixels from the picture's upper left corner, by station or anchor."""


Alignment = str | Mapping[str, tuple[float, float]] | DrawnPlan
"""`walls`; known places (x, y) m of stations and anchors; or a picture in which they are marked."""


def fit_frame(estimate: GraphEstimate, known: Mapping[str, tuple[float, float]]) -> Pose2:
    """site_T_world that brings stations and anchors closest to their known places, without scale.

    Least squares over the points (Umeyama 1991, eq. 40 to 43 with scale one).

    Raises:
        SlamUwbError: fewer than two of them have a place, or their places coincide.
    """
    source, target = _known_places(estimate, known)
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    theta = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    x, y = target.mean(axis=0) - rotation_matrix(theta) @ source.mean(axis=0)
    return Pose2(float(x), float(y), theta)


def fit_picture(estimate: GraphEstimate, drawn: DrawnPlan) -> tuple[Pose2, FloorMap]:
    """picture_T_world, and the picture in its own frame: origin at its lower left corner, x along its width.

    How many metres a pixel is follows from the points (the symmetric scale of Horn 1987): they
    must be as far apart as in the solution.

    Raises:
        SlamUwbError: as `fit_frame`.
    """
    upright = _upright(drawn, 1.0)
    places, pixels = (points - points.mean(axis=0) for points in _known_places(estimate, upright))
    scale = float(np.linalg.norm(places) / np.linalg.norm(pixels))
    picture = FloorMap(drawn.darkness, scale * drawn.pixels_a_cell, (0.0, 0.0))
    return fit_frame(estimate, _upright(drawn, scale)), picture


def misfits(
    estimate: GraphEstimate, align: Alignment | None, picture: FloorMap | None
) -> Iterator[str]:
    """Warnings about points that an alignment leaves far from where they were given.

    Args:
        estimate: in the aligned frame.
        align: what was asked for.
        picture: in the aligned frame, where one was given.
    """
    if align is None or isinstance(align, str):
        return
    if isinstance(align, DrawnPlan):
        scale = picture.resolution / align.pixels_a_cell if picture else math.nan
        known: Mapping[str, tuple[float, float]] = _upright(align, scale)
    else:
        known = align
    for name, place, given in zip(known, *_known_places(estimate, known), strict=True):
        away = float(np.linalg.norm(place - given))
        if away > _MISFIT_M:
            yield f"--align: {name} is {away:.2f} m from where it was given: check the points"


def _upright(drawn: DrawnPlan, scale: float) -> dict[str, tuple[float, float]]:
    """The points of a picture from its lower left corner, y upwards, times a scale."""
    return {
        name: (scale * column, scale * (drawn.height - row))
        for name, (column, row) in drawn.points.items()
    }


def _known_places(
    estimate: GraphEstimate, known: Mapping[str, tuple[float, float]]
) -> tuple[Points, Points]:
    """(K, 2) the places of the solution and what is known of them, two or more and not all one."""
    places: dict[str, Points] = {
        str(s.id): s.pose.translation for s in estimate.stations if s.pose is not None
    }
    places |= {str(a.id): a.position for a in estimate.anchors if a.position is not None}
    missing = sorted(known.keys() - places.keys())
    if missing:
        raise SlamUwbError(f"--align: {', '.join(missing)} has no place in the solution")
    if len(known) < 2:
        raise SlamUwbError("--align: two points are needed to fix a frame")
    source = np.array([places[name] for name in known])
    target = np.array(list(known.values()))
    if min(np.ptp(points, axis=0).max() for points in (source, target)) < 1e-6:
        raise SlamUwbError("--align: the points coincide")
    return source, target


def main_direction(segments: FloatArray) -> float:
    """rad, (-pi/4, pi/4], by which walls (S, 2, 2) are turned from the axes; longer ones count more.

    The mean of four times the angle: walls at right angles say the same.
    """
    way = segments[:, 1] - segments[:, 0]
    angle = 4.0 * np.arctan2(way[:, 1], way[:, 0])
    length = np.hypot(*way.T)
    return math.atan2(float(length @ np.sin(angle)), float(length @ np.cos(angle))) / 4.0


def _station(item: StationEstimate, new_T_world: Pose2) -> StationEstimate:
    pose = None if item.pose is None else new_T_world @ item.pose
    if pose is not None and not item.heading_known:
        # Without a heading the axes are the frame's, so the covariance turns with them.
        turn = np.eye(3)
        turn[:2, :2] = new_T_world.rotation
        covariance = None if item.covariance is None else turn @ item.covariance @ turn.T
        item = replace(item, covariance=covariance)
        pose = Pose2(pose.x, pose.y, 0.0)
    return replace(item, pose=pose, alternatives=_moved(item.alternatives, new_T_world))


def _anchor(item: AnchorEstimate, new_T_world: Pose2) -> AnchorEstimate:
    turn = new_T_world.rotation
    return replace(
        item,
        position=None if item.position is None else new_T_world.transform(item.position),
        covariance=None if item.covariance is None else turn @ item.covariance @ turn.T,
        alternatives=_moved(item.alternatives, new_T_world),
    )


def _moved(items: Sequence[Alternative], new_T_world: Pose2) -> tuple[Alternative, ...]:
    moved = []
    for item in items:
        pose = new_T_world @ Pose2(item.x, item.y, item.theta or 0.0)
        theta = None if item.theta is None else pose.theta
        moved.append(replace(item, x=pose.x, y=pose.y, theta=theta))
    return tuple(moved)


def _joint(estimate: GraphEstimate, theta: float) -> FloatArray | None:
    if estimate.joint_covariance is None:
        return None
    size = len(estimate.joint_covariance)
    # 3 rows a station, 2 an anchor: the rows tell where the anchors begin.
    stations = size - 2 * len(estimate.joint_names)
    blind = {s.id for s in estimate.stations if not s.heading_known}
    turn, rotation = np.eye(size), rotation_matrix(theta)
    for k, name in enumerate(estimate.joint_names):
        row = 3 * k if k < stations else 3 * stations + 2 * (k - stations)
        if k >= stations or name in blind:
            turn[row : row + 2, row : row + 2] = rotation
    return np.asarray(turn @ estimate.joint_covariance @ turn.T)
