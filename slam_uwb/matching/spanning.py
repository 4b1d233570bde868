"""Groups of stations that matches connect, and their poses along the best of these matches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.survey import StationId


def spanning_placement(
    stations: Sequence[StationId], matches: Sequence[ScanMatch]
) -> dict[StationId, Pose2]:
    """Poses of the largest group of stations that the matches connect, along the maximum-score spanning tree.

    The frame is that of the group's first station in the order given.
    """
    order = {station: index for index, station in enumerate(stations)}
    group = {station: {station: Pose2.identity()} for station in stations}
    for match in sorted(
        matches, key=lambda match: (-match.score, order[match.target], order[match.source])
    ):
        a, b = group[match.target], group[match.source]
        if a is b:
            continue
        a_T_b = a[match.target] @ match.target_T_source @ b[match.source].inverse()
        a.update({station: a_T_b @ pose for station, pose in b.items()})
        group.update(dict.fromkeys(b, a))
    # Of groups of one size the one whose first station comes first.
    largest = max((group[station] for station in stations), key=len, default={})
    return in_first_frame({station: largest[station] for station in stations if station in largest})


def largest_group(
    placement: Mapping[StationId, Pose2], matches: Sequence[ScanMatch]
) -> dict[StationId, Pose2]:
    """The largest group of stations of a placement that the matches connect, in its first station's frame."""
    connected = spanning_placement(tuple(placement), matches)
    return in_first_frame({station: placement[station] for station in connected})


def in_first_frame(placement: Mapping[StationId, Pose2]) -> dict[StationId, Pose2]:
    """The placement in the frame of its first station."""
    if not placement:
        return {}
    first_T_world = next(iter(placement.values())).inverse()
    return {station: first_T_world @ pose for station, pose in placement.items()}
