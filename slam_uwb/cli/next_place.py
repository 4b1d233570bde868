"""Where to carry the tripod next, in the words of somebody who stands beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..model.geometry import Pose2, Vector2
    from ..model.solution import Solution
    from ..planning import Suggestion

_SIDES = (
    "ahead of",
    "ahead to the left of",
    "to the left of",
    "behind to the left of",
    "behind",
    "behind to the right of",
    "to the right of",
    "ahead to the right of",
)
"""Every 45 degrees counter-clockwise."""


@dataclass(frozen=True, slots=True, eq=False)
class NextPlace:
    """A place to go to."""

    place: Vector2
    """(2,) m, world frame."""
    words: str


def find_next_place(solution: Solution, station: str) -> NextPlace | None:
    """The most useful place, told from `station`, or from the last placed one where that is not placed.

    None where there is none to suggest: no map with room for a tripod, or no anchor that anybody heard.
    """
    from ..planning import suggest_stations

    here = _placed(solution, station)
    found = suggest_stations(solution, 1, solution.settings.planning)
    if here is None or not found:
        return None
    name, pose, heading_known = here
    way = _way(pose, found[0].place, heading_known=heading_known)
    return NextPlace(
        found[0].place, f"{way} {name}{_nearest(solution, name, found[0].place)}{_gain(found[0])}"
    )


def _placed(solution: Solution, station: str) -> tuple[str, Pose2, bool] | None:
    """Name, world_T_station and whether its heading is known, of the wanted station or the last placed one."""
    placed = [
        (str(s.id), s.pose, s.heading_known)
        for s in solution.stations
        if s.pose is not None and s.status == "ok"
    ]
    wanted = [item for item in placed if item[0] == station]
    return next(iter(wanted or placed[-1:]), None)


def _way(world_T_station: Pose2, place: Vector2, *, heading_known: bool) -> str:
    """How far and, by the scanner's forward mark, in which direction."""
    x, y = (float(v) for v in world_T_station.inverse().transform(place[None])[0])
    distance = f"{math.hypot(x, y):.1f} m"
    if not heading_known:
        return f"{distance} from"
    bearing = math.degrees(math.atan2(y, x))
    side = _SIDES[round(bearing / 45.0) % 8]
    turn = f"{abs(bearing):.0f} deg {'left' if bearing > 0 else 'right'} of its forward mark"
    return f"{distance} {side} the scanner ({turn}) at"


def _nearest(solution: Solution, besides: str, place: Vector2) -> str:
    """The other station that is nearest: two distances find a place where a direction is hard to tell."""
    others = [
        (math.dist(s.pose.translation, place), str(s.id))
        for s in solution.stations
        if s.pose is not None and str(s.id) != besides
    ]
    return f", {min(others)[0]:.1f} m from {min(others)[1]}" if others else ""


def _gain(suggestion: Suggestion) -> str:
    return (
        f": the expected error of the anchors falls from {suggestion.before:.3f} m to "
        f"{suggestion.after:.3f} m"
    )
