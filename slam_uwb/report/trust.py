"""How far each anchor can be trusted, in words for whoever builds on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ..model.geometry import Points
from ..model.products import LinkMeasurement
from ..model.solution import AnchorEstimate, Solution, Status
from ..model.survey import StationId

SIGMAS = 2.0
"""Ellipses and sigmas of the report."""
_MANY_REJECTED = 1.0 / 3.0
_ONE_SIDED, _ALL_ROUND = math.radians(60.0), math.radians(180.0)
"""Sectors within which all stations stand that hear an anchor."""


class Trust(StrEnum):
    """What to do with an anchor's place."""

    YES = "trust"
    CHECK = "check"
    NO = "do not use"


MEANING: dict[Status, str] = {
    Status.OK: "",
    Status.AMBIGUOUS: "several places explain the data about as well",
    Status.MIRROR_AMBIGUOUS: "its mirror image across the line of stations is not excluded",
    Status.WEAK_GEOMETRY: "its place is too uncertain",
    Status.UNREACHABLE: "heard from too few stations",
    Status.DISCONNECTED: "nothing holds it to the map",
}


@dataclass(frozen=True, slots=True, eq=False)
class AnchorJudgement:
    """What the report says of one anchor."""

    anchor: AnchorEstimate
    two_sigma: float
    """m, half the long axis of the ellipse; NaN without one."""
    used: tuple[LinkMeasurement, ...]
    rejected: tuple[LinkMeasurement, ...]
    through_walls: float
    """Share of the used links that more likely than not cross a wall; NaN without any."""
    open_angle: float
    """rad, the widest sector seen from the anchor in which no station that hears it stands; NaN unknown."""
    trust: Trust
    why: tuple[str, ...]
    """Reasons for anything but trust."""


def judge_anchors(solution: Solution) -> tuple[AnchorJudgement, ...]:
    """One judgement an anchor, in the solution's order."""
    tags = {
        station.id: station.pose.transform(np.array(solution.tag_offset))
        for station in solution.stations
        if station.pose is not None
    }
    return tuple(_judge(anchor, solution, tags) for anchor in solution.anchors)


def largest_two_sigma(covariance: Points | None) -> float:
    """m, two sigmas along the worst direction of a covariance (its first two axes); NaN without one."""
    if covariance is None or not np.isfinite(covariance[:2, :2]).all():
        return math.nan
    return SIGMAS * math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))


def widest_gap(place: Points, others: Points) -> float:
    """rad, the widest sector round `place` (2,) without any of `others` (N, 2); NaN for none."""
    if not len(others):
        return math.nan
    bearings = np.sort(np.arctan2(others[:, 1] - place[1], others[:, 0] - place[0]))
    return float(np.diff(bearings, append=bearings[0] + 2.0 * math.pi).max())


def _judge(
    anchor: AnchorEstimate, solution: Solution, tags: Mapping[StationId, Points]
) -> AnchorJudgement:
    links = [link for link in solution.links if link.anchor == anchor.id]
    used = tuple(link for link in links if link.rejection is None)
    rejected = tuple(link for link in links if link.rejection is not None)
    blocked = [link.nlos_probability > 0.5 for link in used if math.isfinite(link.nlos_probability)]
    heard = np.array([tags[k.station] for k in used if k.station in tags]).reshape(-1, 2)
    judged = AnchorJudgement(
        anchor=anchor,
        two_sigma=largest_two_sigma(None if anchor.position is None else anchor.covariance),
        used=used,
        rejected=rejected,
        through_walls=sum(blocked) / len(blocked) if blocked else math.nan,
        open_angle=math.nan if anchor.position is None else widest_gap(anchor.position, heard),
        trust=Trust.YES,
        why=(),
    )
    trust, why = _trust(judged, solution.settings.graph.weak_sigma_m)
    return replace(judged, trust=trust, why=why)


def _trust(judged: AnchorJudgement, weak_sigma: float) -> tuple[Trust, tuple[str, ...]]:
    anchor = judged.anchor
    if anchor.status is not Status.OK or anchor.position is None:
        return Trust.NO, (MEANING[anchor.status] or "it has no place",)
    doubts = []
    count = len(judged.used) + len(judged.rejected)
    if len(judged.rejected) > 1 and len(judged.rejected) > _MANY_REJECTED * count:
        doubts.append(f"{len(judged.rejected)} of its {count} links contradict its place")
    # Half of what the solver itself calls weak: still a place, but one to know about.
    if not judged.two_sigma <= weak_sigma:
        doubts.append(f"2 sigma is {judged.two_sigma:.2f} m")
    if judged.through_walls == 1.0:
        doubts.append("none of its ranges is in line of sight")
    return (Trust.CHECK if doubts else Trust.YES), tuple(doubts)


def describe_geometry(judged: AnchorJudgement) -> str:
    """From where an anchor is seen, in words."""
    if not math.isfinite(judged.open_angle):
        return ""
    seen_from = 2.0 * math.pi - judged.open_angle
    side = "several sides" if seen_from > _ONE_SIDED else "one side"
    if seen_from > _ALL_ROUND:
        side = "all round"
    return f"{side} ({round(math.degrees(seen_from))}°)"
