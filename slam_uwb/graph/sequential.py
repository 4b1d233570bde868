"""The paper's method, the baseline: chain the matches (eq. 6-9), then fit each anchor (eq. 10).

Anchors are fitted separately, to averaged ranges, by least squares, with nothing robust and no
offset but the one that the survey states. Poses are taken as they come.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Matrix3, Pose2, Vector2
from ..model.products import GraphProblem, LinkMeasurement, Share, alone
from ..model.settings import GraphSettings
from ..model.solution import GraphEstimate, Status
from ..model.survey import Anchor, AnchorId, KnownPlace, Station, StationId
from .chain import compose_chain, held_together, spanning_tree
from .estimate import Solved, build_estimate, joint_order
from .factors import GAUGE_SIGMA, WEAK_HEADING_SIGMA
from .find import Scene
from .frame import alignment_covariance, choose_start, tie_to_site
from .multilateration import fit_point
from .ranges import anchor_sightings, link_reasons, station_sightings
from .sightings import Finding
from .variables import Variables

Fitted = tuple[Finding, Matrix2 | None]


def solve_sequential(
    problem: GraphProblem, settings: GraphSettings, share: Share = alone
) -> GraphEstimate:
    """Poses by chaining matches, then every anchor by itself (the paper).

    Stations that only ranges can place are located in the same way from the fitted anchors.

    Args:
        problem: matches that hold together, links, known places.
        settings: limits of what is called determined.
        share: as every solver has it; here there is nothing to share out.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
    """
    chained = _chained(problem)
    start = choose_start(chained)
    solved = _solve_from(Scene.of(chained, start, settings, share))
    site = tie_to_site(chained, start, *_sure(solved))
    if site is not None:
        solved = _solve_from(Scene.of(chained, site, settings, share))
    estimate = build_estimate(chained, solved, settings)
    links = zip(estimate.links, problem.links, strict=True)
    return replace(
        estimate, links=tuple(replace(link, distance=was.distance) for link, was in links)
    )


def _chained(problem: GraphProblem) -> GraphProblem:
    """The problem with poses by eq. 6-9 as its placement and plain averages as its ranges."""
    names = held_together(problem)
    poses: dict[StationId, Pose2] = {}
    if names:
        tree = spanning_tree(problem)
        poses = compose_chain(tree, names[0], Pose2.identity(), np.zeros((3, 3))).poses
    links = tuple(replace(link, distance=link.mean) for link in problem.links)
    return replace(problem, placement=poses, links=links)


def _sure(solved: Solved) -> tuple[dict[StationId, Pose2], dict[AnchorId, Vector2]]:
    """Stations that ranges located and anchors, in the solved frame, those that are `ok`."""
    poses, anchors = solved.variables.poses, solved.variables.anchors
    return (
        {n: poses[n] for n, f in solved.stations.items() if f.status is Status.OK},
        {n: anchors[n] for n, f in solved.anchors.items() if f.status is Status.OK},
    )


def _solve_from(scene: Scene) -> Solved:
    """Anchors, then lost stations, at the poses of the start."""
    problem, start = scene.problem, scene.start
    offset = 0.0 if problem.range_offset is None else problem.range_offset.mean
    reasons = link_reasons(problem)
    links = tuple(k for k, reason in zip(problem.links, reasons, strict=True) if reason is None)
    tags = scene.levers.tags(start.poses)
    fits = {a.id: _fit_anchor(scene, a, links, tags, offset) for a in problem.anchors}
    anchors = {n: found.place for n, (found, _) in fits.items() if found.place is not None}
    sure = {n: place for n, place in anchors.items() if fits[n][0].status is Status.OK}
    heights = {n: found.height for n, (found, _) in fits.items() if found.height is not None}
    lost: dict[StationId, Fitted] = {}
    for station in problem.stations:
        if station.scan is None and station.id not in start.poses:
            seen = station_sightings(links, station.id, sure, heights)
            lost[station.id] = fit_point(seen, station.tag_height, offset, scene.settings)
    variables = Variables(_all_poses(scene, lost), anchors, offset)
    blocks = {n: c for n, (_, c) in fits.items() if c is not None}
    return Solved(
        start=start,
        variables=variables,
        covariance=_joint_covariance(scene, variables, blocks, lost),
        anchors={name: found for name, (found, _) in fits.items()},
        stations={name: found for name, (found, _) in lost.items()},
        levers=scene.levers,
    )


def _fit_anchor(
    scene: Scene,
    anchor: Anchor,
    links: tuple[LinkMeasurement, ...],
    tags: Mapping[StationId, Vector2],
    offset: float,
) -> Fitted:
    """Eq. 10 for one anchor; a known one is left where it is."""
    seen = anchor_sightings(scene.problem, links, anchor.id, tags, {}, {})
    known = scene.known_place(anchor)
    if known is None or anchor.known is None:
        return fit_point(seen, anchor.height, offset, scene.settings)
    finding = Finding(Status.OK, known, anchor.height, len(seen.points))
    return finding, anchor.known.sigma**2 * np.eye(2)


def _all_poses(scene: Scene, lost: Mapping[StationId, Fitted]) -> dict[StationId, Pose2]:
    """Poses of the start with those that ranges found, in the survey's order."""
    poses = {}
    for station in scene.problem.stations:
        if station.id in scene.start.poses:
            poses[station.id] = scene.start.poses[station.id]
        elif station.id in lost and (place := lost[station.id][0].place) is not None:
            poses[station.id] = Pose2(float(place[0]), float(place[1]), 0.0)
    return poses


def _joint_covariance(
    scene: Scene,
    variables: Variables,
    anchor_blocks: Mapping[AnchorId, Matrix2],
    lost: Mapping[StationId, Fitted],
) -> FloatArray:
    """(M, M) in the order of `joint_order`: chained stations together, all else by itself."""
    stations, anchors = joint_order(scene.problem, variables)
    size = 3 * len(stations)
    covariance = np.zeros((size + 2 * len(anchors),) * 2)
    rows = {name: np.arange(3 * k, 3 * k + 3) for k, name in enumerate(stations)}
    chained = [name for name in stations if name in scene.start.group]
    if chained:
        root = chained[0]
        chain = compose_chain(
            spanning_tree(scene.problem),
            root,
            variables.poses[root],
            _root_covariance(scene, variables, root),
        )
        at = np.concatenate([rows[name] for name in chain.poses])
        covariance[np.ix_(at, at)] = chain.covariance
    known = {station.id: station for station in scene.problem.stations}
    for name in stations:
        if name not in scene.start.group:
            block = _lone_covariance(known[name], lost.get(name))
            covariance[np.ix_(rows[name], rows[name])] = block
    for k, anchor in enumerate(anchors):
        at = np.arange(size + 2 * k, size + 2 * k + 2)
        covariance[np.ix_(at, at)] = anchor_blocks[anchor]
    return covariance


def _lone_covariance(station: Station, found: Fitted | None) -> Matrix3:
    """(3, 3) of a station outside the chain: as surveyed, or as its ranges locate it."""
    known: KnownPlace | None = station.known
    covariance = np.diag([0.0, 0.0, WEAK_HEADING_SIGMA**2])
    if found is not None and found[1] is not None:
        covariance[:2, :2] = found[1]
    elif known is not None:
        turn = WEAK_HEADING_SIGMA if known.theta is None else known.sigma_theta
        covariance = np.diag([known.sigma**2, known.sigma**2, turn**2])
    return covariance


def _root_covariance(scene: Scene, variables: Variables, root: StationId) -> Matrix3:
    """(3, 3) of the chain's first station: the gauge's, or the alignment's on control points."""
    problem, chained = scene.problem, scene.start.group
    if not scene.start.in_site:
        return GAUGE_SIGMA**2 * np.eye(3)
    controls = [
        (variables.poses[station.id].translation, station.known)
        for station in problem.stations
        if station.known is not None and station.id in chained
    ]
    if len(controls) < 2 and all(known.theta is None for _, known in controls):
        # The chain was tied to the site by ranges, to anchors or to stations outside of it.
        places = [p.known for p in problem.anchors] + [p.known for p in problem.stations]
        controls = [(np.array([known.x, known.y]), known) for known in places if known is not None]
    return alignment_covariance(scene.start, root, controls)
