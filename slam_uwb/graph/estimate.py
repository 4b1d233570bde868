"""What a solver found -> what it delivers: statuses, covariances, residuals and reasons."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Matrix3, Pose2
from ..model.products import GraphProblem, LinkMeasurement
from ..model.settings import GraphSettings
from ..model.solution import (
    AnchorEstimate,
    Bias,
    GraphEstimate,
    SolverChecks,
    StationEstimate,
    Status,
)
from ..model.survey import Anchor, AnchorId, Station, StationId
from .frame import Start
from .ranges import Levers, link_reasons
from .sightings import Finding
from .variables import Variables
from .verdicts import LinkName, LinkVerdict


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """What a solver found, in one frame."""

    start: Start
    variables: Variables
    covariance: FloatArray
    """(M, M) joint, in the order of `joint_order`: 3 rows a station, in its own axes, 2 an anchor."""
    anchors: dict[AnchorId, Finding]
    """Of every anchor of the problem."""
    stations: dict[StationId, Finding]
    """Of the stations that only ranges can place."""
    levers: Levers
    biases: tuple[Bias, ...] = ()
    checks: SolverChecks | None = None
    verdicts: Mapping[LinkName, LinkVerdict] = field(default_factory=dict)
    """Of the links that were used."""


def joint_order(
    problem: GraphProblem, variables: Variables
) -> tuple[list[StationId], list[AnchorId]]:
    """Solved stations and anchors in the survey's order: that of the joint covariance."""
    stations = [s.id for s in problem.stations if s.id in variables.poses]
    return stations, [a.id for a in problem.anchors if a.id in variables.anchors]


def build_estimate(problem: GraphProblem, solved: Solved, settings: GraphSettings) -> GraphEstimate:
    """Every station, anchor and link of the problem with what was found, or why not."""
    covariance = _widened(problem, solved)
    station_names, anchor_names = joint_order(problem, solved.variables)
    blocks: dict[StationId, Matrix3] = {
        name: covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        for k, name in enumerate(station_names)
    }
    first = 3 * len(station_names)
    anchor_blocks: dict[AnchorId, Matrix2] = {
        name: covariance[first + 2 * k : first + 2 * k + 2, first + 2 * k : first + 2 * k + 2]
        for k, name in enumerate(anchor_names)
    }
    links = _links(problem, solved)
    return GraphEstimate(
        stations=tuple(_station(s, solved, blocks, settings) for s in problem.stations),
        anchors=tuple(_anchor(a, solved, anchor_blocks, links, settings) for a in problem.anchors),
        links=links,
        frame=solved.start.frame,
        biases=solved.biases,
        joint_names=(*station_names, *anchor_names),
        joint_covariance=covariance,
        checks=solved.checks,
    )


def is_weak(covariance: FloatArray, sigma: float) -> bool:
    """Whether a place with this covariance (first two axes) is less sure than `sigma`, m, in any direction."""
    return float(np.linalg.eigvalsh(covariance[:2, :2])[-1]) > sigma**2


def _widened(problem: GraphProblem, solved: Solved) -> FloatArray:
    """The joint covariance with what the graph does not model.

    A heading that nobody knows turns the lever arm anywhere: variance |lever|^2 / 2 on each axis.
    The rest is what was found to add to single places (`Finding.extra`).
    """
    covariance = np.array(solved.covariance)
    station_names, anchor_names = joint_order(problem, solved.variables)
    lever_variance = float(solved.levers.offset @ solved.levers.offset) / 2.0
    for k, name in enumerate(station_names):
        if name not in solved.levers.headings:
            covariance[[3 * k, 3 * k + 1], [3 * k, 3 * k + 1]] += lever_variance
        # A station that ranges found has heading zero: its axes are the world's.
        if name in solved.stations and (extra := solved.stations[name].extra) is not None:
            covariance[3 * k : 3 * k + 2, 3 * k : 3 * k + 2] += extra
    for k, anchor in enumerate(anchor_names):
        if (extra := solved.anchors[anchor].extra) is not None:
            at = 3 * len(station_names) + 2 * k
            covariance[at : at + 2, at : at + 2] += extra
    return covariance


def _station(
    station: Station, solved: Solved, blocks: dict[StationId, Matrix3], settings: GraphSettings
) -> StationEstimate:
    pose = solved.variables.poses.get(station.id)
    finding = solved.stations.get(station.id)
    if pose is None:
        if finding is None or finding.status is Status.UNREACHABLE:
            return StationEstimate(station.id, None, None, Status.DISCONNECTED, heading_known=False)
        return StationEstimate(
            station.id, None, None, finding.status, False, alternatives=finding.alternatives
        )
    heading_known = station.id in solved.levers.headings
    status = Status.OK if finding is None else finding.status
    scanned = finding is None
    if is_weak(
        blocks[station.id], settings.weak_pose_sigma_m if scanned else settings.weak_sigma_m
    ):
        status = Status.WEAK_GEOMETRY
    shown = pose if heading_known else Pose2(pose.x, pose.y, 0.0)
    return StationEstimate(station.id, shown, blocks[station.id], status, heading_known)


def _anchor(
    anchor: Anchor,
    solved: Solved,
    blocks: dict[AnchorId, Matrix2],
    links: tuple[LinkMeasurement, ...],
    settings: GraphSettings,
) -> AnchorEstimate:
    finding = solved.anchors[anchor.id]
    used = sum(link.anchor == anchor.id and link.rejection is None for link in links)
    place = solved.variables.anchors.get(anchor.id)
    height = anchor.height if anchor.height is not None else finding.height
    if place is None:
        return AnchorEstimate(
            anchor.id, None, None, height, used, finding.status, finding.alternatives
        )
    status = finding.status
    if status is Status.OK and is_weak(blocks[anchor.id], settings.weak_sigma_m):
        status = Status.WEAK_GEOMETRY
    return AnchorEstimate(anchor.id, place, blocks[anchor.id], height, used, status)


def _links(problem: GraphProblem, solved: Solved) -> tuple[LinkMeasurement, ...]:
    """All links, with the residual wherever both ends are placed, and the reason where not used."""
    tags = solved.levers.tags(solved.variables.poses)
    tag_heights = {station.id: station.tag_height for station in problem.stations}
    filled = []
    for link, reason in zip(problem.links, link_reasons(problem), strict=True):
        place = solved.variables.anchors.get(link.anchor)
        height = solved.anchors[link.anchor].height
        if reason is None and link.station not in tags:
            reason = "the station is not placed"
        elif reason is None and (place is None or height is None):
            finding = solved.anchors[link.anchor]
            reason = finding.note or f"the anchor is {finding.status.value}"
        residual = math.nan
        if link.station in tags and place is not None and height is not None:
            rise = height - tag_heights[link.station]
            slant = math.hypot(math.dist(tags[link.station], place), rise)
            residual = link.distance - solved.variables.offset_of(link.anchor) - slant
        filled.append(replace(link, residual=residual, rejection=reason))
        verdict = solved.verdicts.get(link.name)
        if verdict is not None and reason is None:
            filled[-1] = replace(
                filled[-1],
                walls=verdict.walls,
                nlos_probability=verdict.nlos_probability,
                rejection=verdict.fault,
            )
    return tuple(filled)
