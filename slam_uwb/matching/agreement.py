"""Whether two poses of a pair are one place, and where a placement has the pair."""

from __future__ import annotations

from collections.abc import Mapping

from ..model.geometry import Pose2
from ..model.survey import StationId

_SAME_M, _SAME_RAD = 0.25, 0.1  # a pose this close to another is the same one, less refined


def placed(
    target: StationId, source: StationId, placement: Mapping[StationId, Pose2]
) -> Pose2 | None:
    """target_T_source by a placement (world_T_station); None where one of the two has no place."""
    if target not in placement or source not in placement:
        return None
    return placement[target].inverse() @ placement[source]


def same_place(
    a: Pose2, b: Pose2 | None, metres: float = _SAME_M, radians: float = _SAME_RAD
) -> bool:
    """Whether two poses of a pair are nearer to each other than both limits; nothing is near None."""
    return b is not None and a.distance_to(b) < metres and a.angle_to(b) < radians
