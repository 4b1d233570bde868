"""The method: one problem over station poses, anchors and the range offset.

Rounds of two steps: find what the ranges determine at the present poses (`find`), solve all of it
together (`incremental`). They end when solving no longer changes what is found.
"""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np

from ..model.geometry import Pose2
from ..model.products import GraphProblem, LinkMeasurement
from ..model.settings import GraphSettings
from ..model.solution import Bias, GraphEstimate, SolverChecks, Status
from ..model.survey import RangeOffset
from . import factors
from .estimate import Solved, build_estimate, joint_order
from .find import Found, Scene, find_points
from .frame import Start, choose_start, tie_to_site
from .incremental import Optimum, batch_gap, dense_covariance, solve_by_passes
from .ranges import build_range_table, usable_links
from .spread import add_tails
from .variables import Indices, Variables

MAX_ROUNDS = 6
"""Two are the rule; more only where a point jumps between two minima."""


def solve_joint(problem: GraphProblem, settings: GraphSettings) -> GraphEstimate:
    """Solve poses, anchors and offset together (iSAM2, one-sided loss against long ranges).

    Args:
        problem: matches that hold together, links, known places.
        settings: see `GraphSettings`.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
        SolverError: something is not determined or not finite.
    """
    scene = Scene.of(problem, choose_start(problem), settings)
    optimum, found = _solve_rounds(scene)
    site = _site_by_ranges(scene, optimum.variables, found)
    if site is not None:
        scene = Scene.of(problem, site, settings)
        optimum, found = _solve_rounds(scene)
    return build_estimate(problem, _deliver(scene, optimum, found), settings)


def _solve_rounds(scene: Scene) -> tuple[Optimum, Found]:
    """Solve and find in turns until both agree."""
    # Poses by the matches alone first: chained ones are a poor place to look from.
    start = Variables(dict(scene.start.poses), {}, scene.prior.mean)
    found = Found({}, {})
    optimum = _solve_once(scene, start, found, ())
    scene = _with_honest_matches(scene, optimum)
    optimum = _solve_once(scene, optimum.variables, found, ())
    for _ in range(MAX_ROUNDS):
        present = optimum.variables
        links = usable_links(scene.problem, present.poses, scene.settings)
        found = find_points(scene, present, links, found)
        if found.agrees_with(present, scene.settings.twin_distance_m):
            break
        optimum = _solve_once(scene, _enter(scene, present, found), found, links)
    return optimum, found


def _with_honest_matches(scene: Scene, optimum: Optimum) -> Scene:
    """The scene with the covariances of its matches scaled to how well the matches agree.

    Where more matches than needed disagree by more than their covariances say, these are too small:
    all are multiplied by the variance of unit weight (chi-square by degrees of freedom). They are
    never made smaller.
    """
    graph = _match_factors(scene)
    freedom = 3 * (graph.size() - (len(scene.start.group) - 1))
    if freedom <= 0:
        return scene
    factor = max(1.0, 2.0 * graph.error(optimum.values) / freedom)
    matches = tuple(replace(m, covariance=factor * m.covariance) for m in scene.problem.matches)
    return replace(scene, problem=replace(scene.problem, matches=matches))


def _match_factors(scene: Scene) -> gtsam.NonlinearFactorGraph:
    """Between factors of all matches of the solved group."""
    graph = gtsam.NonlinearFactorGraph()
    indices, group = Indices.of(scene.problem), scene.start.group
    for match in scene.problem.matches:
        if match.target in group and match.source in group:
            ends = (indices.stations[match.target], indices.stations[match.source])
            graph.push_back(factors.match_factor(match, *ends))
    return graph


def _enter(scene: Scene, present: Variables, found: Found) -> Variables:
    """All that was found, started where it is now or, where that is another minimum, where found."""
    near = scene.settings.twin_distance_m
    anchors = {
        name: place
        if (now := present.anchors.get(name)) is None or np.hypot(*(now - place)) > near
        else now
        for name, finding in found.anchors.items()
        if (place := finding.place) is not None
    }
    poses = {}
    for station in scene.problem.stations:
        finding = found.stations.get(station.id)
        if station.id in scene.start.poses:
            poses[station.id] = present.poses[station.id]
        elif finding is not None and finding.place is not None:
            poses[station.id] = Pose2(float(finding.place[0]), float(finding.place[1]), 0.0)
    return Variables(poses, anchors, present.offset)


def _solve_once(
    scene: Scene, start: Variables, found: Found, links: tuple[LinkMeasurement, ...]
) -> Optimum:
    lost = frozenset(start.poses.keys() - scene.start.poses.keys())
    table = build_range_table(scene.problem, links, start, found.heights(), scene.levers, lost)
    fixed = _fixed_factors(scene, start, with_offset=len(table.measured) > 0)
    return solve_by_passes(fixed, table, start, Indices.of(scene.problem), scene.settings)


def _fixed_factors(scene: Scene, start: Variables, with_offset: bool) -> gtsam.NonlinearFactorGraph:
    """Matches and priors: all that does not depend on how long the ranges are."""
    graph, indices = _match_factors(scene), Indices.of(scene.problem)
    gauge = scene.start.gauge
    if gauge is not None and not (scene.start.in_site and start.anchors):
        graph.push_back(factors.gauge_factor(indices.stations[gauge], scene.start.poses[gauge]))
    for station in scene.problem.stations:
        if station.id not in start.poses:
            continue
        key = indices.stations[station.id]
        if scene.start.in_site and station.known is not None:
            for prior in factors.known_station_factors(key, station.known):
                graph.push_back(prior)
        if station.id not in scene.start.headings:
            graph.push_back(factors.heading_factor(key, 0.0))
    for anchor in scene.problem.anchors:
        if anchor.id in start.anchors:
            known = anchor.known
            if known is not None and scene.start.in_site:
                place, key = np.array([known.x, known.y]), indices.anchors[anchor.id]
                graph.push_back(factors.anchor_prior(key, place, known.sigma))
    if with_offset:
        graph.push_back(factors.offset_prior(scene.prior))
    return graph


def _site_by_ranges(scene: Scene, solved: Variables, found: Found) -> Start | None:
    """The start in the site's frame, where points found by ranges are what fixes it."""
    anchors = {
        name: place
        for name, place in solved.anchors.items()
        if found.anchors[name].status is Status.OK
    }
    located = {
        name: solved.poses[name]
        for name, finding in found.stations.items()
        if finding.status is Status.OK and name in solved.poses
    }
    poses = {name: solved.poses[name] for name in scene.start.poses}
    return tie_to_site(scene.problem, replace(scene.start, poses=poses), located, anchors)


def _deliver(scene: Scene, optimum: Optimum, found: Found) -> Solved:
    """Covariances, bias and checks of the final linearisation."""
    problem, indices = scene.problem, Indices.of(scene.problem)
    stations, anchors = joint_order(problem, optimum.variables)
    keys = [factors.X(indices.stations[name]) for name in stations]
    keys += [factors.L(indices.anchors[name]) for name in anchors]
    size = 3 * len(stations) + 2 * len(anchors)
    has_offset = optimum.values.exists(factors.OFFSET_KEY)
    covariance = dense_covariance(optimum, keys + [factors.OFFSET_KEY] * has_offset)
    biases: tuple[Bias, ...] = ()
    if has_offset:
        prior = scene.prior
        offset = RangeOffset(optimum.variables.offset, float(np.sqrt(covariance[size, size])))
        biases = (Bias("range offset", offset.mean, offset.sigma, prior.mean, prior.sigma),)
        found = add_tails(scene, optimum.variables, found, covariance, offset)
    return Solved(
        start=scene.start,
        variables=optimum.variables,
        covariance=covariance[:size, :size],
        anchors=found.settled(optimum.variables, scene.settings.twin_distance_m),
        stations=found.stations,
        levers=scene.levers,
        biases=biases,
        checks=SolverChecks(batch_gap(optimum, indices), optimum.passes, optimum.cost),
    )
