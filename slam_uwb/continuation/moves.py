"""What new stations changed: how far each station and anchor moved, and how certain it was and is."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..model.geometry import FloatArray, Pose2, Vector2
from ..model.solution import (
    AnchorEstimate,
    Continuation,
    GraphEstimate,
    Move,
    Solution,
    StationEstimate,
)


def what_moved(
    earlier: Solution, estimate: GraphEstimate, aligned_T_world: Pose2 | None
) -> Continuation:
    """How every station and anchor of an earlier solution moved.

    Args:
        earlier: the solution that was continued.
        estimate: the present one.
        aligned_T_world: how its frame was moved from that of its station, if it was.

    Returns:
        Moves in the frame of both, or where it changed as seen from the first station of both.
    """
    new_T_old: Pose2 | None = Pose2.identity()
    seen_from = None
    if (earlier.frame, earlier.alignment) != (estimate.frame, aligned_T_world):
        new_T_old, seen_from = _seen_from(earlier, estimate)
    return Continuation(
        checksum=earlier.checksum,
        added=tuple(
            s.id for s in estimate.stations if s.id not in {old.id for old in earlier.stations}
        ),
        seen_from=seen_from,
        moves=tuple(_moves(earlier, estimate, new_T_old)),
    )


def _seen_from(earlier: Solution, estimate: GraphEstimate) -> tuple[Pose2 | None, str | None]:
    """new_T_old by the first station that both place with its heading."""
    before = {s.id: s.pose for s in earlier.stations if s.pose is not None and s.heading_known}
    for station in estimate.stations:
        if station.id in before and station.pose is not None and station.heading_known:
            return station.pose @ before[station.id].inverse(), station.id
    return None, None


def _moves(earlier: Solution, estimate: GraphEstimate, new_T_old: Pose2 | None) -> Iterator[Move]:
    """Of all that the earlier solution lists and the survey still has, stations first."""
    stations = {item.id: item for item in estimate.stations}
    for old in earlier.stations:
        if old.id in stations:
            yield _move("station", old, stations[old.id], new_T_old)
    anchors = {item.id: item for item in estimate.anchors}
    for was in earlier.anchors:
        if was.id in anchors:
            yield _move("anchor", was, anchors[was.id], new_T_old)


def _move(
    kind: str,
    old: StationEstimate | AnchorEstimate,
    new: StationEstimate | AnchorEstimate,
    new_T_old: Pose2 | None,
) -> Move:
    before, after = _place(old), _place(new)
    distance = math.nan
    if before is not None and after is not None and new_T_old is not None:
        distance = float(np.linalg.norm(after - new_T_old.transform(before)))
    return Move(
        kind=kind,
        id=str(old.id),
        distance=distance,
        before=_sigma(old.covariance),
        after=_sigma(new.covariance),
        status_before=old.status,
        status_after=new.status,
    )


def _place(item: StationEstimate | AnchorEstimate) -> Vector2 | None:
    if isinstance(item, AnchorEstimate):
        return item.position
    return None if item.pose is None else item.pose.translation


def _sigma(covariance: FloatArray | None) -> float:
    """m, along the longest axis of the ellipse; turning the axes does not change it."""
    if covariance is None or not np.isfinite(covariance[:2, :2]).all():
        return math.nan
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))
