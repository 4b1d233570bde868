"""The method: one problem over station poses, anchors and the range offset.

Rounds of two steps: find what the ranges determine at the present poses (`find`), solve all of it
together (`incremental`). They end when solving no longer changes what is found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import gtsam
import numpy as np

from ..model.errors import SolverError
from ..model.geometry import Pose2
from ..model.link_law import LinkModel
from ..model.products import GraphProblem, LinkMeasurement, Share, alone
from ..model.settings import GraphSettings
from ..model.solution import Bias, GraphEstimate, Status
from . import factors
from .cross_check import check_optimum
from .estimate import Solved, build_estimate, joint_order
from .find import Found, Scene, find_points
from .frame import Start, choose_start, tie_to_site
from .incremental import Optimum, dense_covariance, solve_by_passes
from .learn import learn_links, needs_no_offsets
from .ranges import build_range_table, usable_links, weigh_ranges
from .settling import Labels, next_labels
from .sides import NO_SIDES, Sides, likely_sides, side_factors
from .spread import add_tails
from .variables import Indices, Variables, movement
from .verdicts import judge_links

MAX_ROUNDS = 30
"""Three or four are the rule; more only where a point jumps between two minima."""
LEARNING_ROUNDS = 2
"""Then walls, link model and the choice between minima stand; only labels still follow the places."""
STILL = 1e-7
"""m. Rounds end where no anchor moves further: its labels are then those of where it is."""
PATIENT_ROUNDS = 8
"""Then twice as much is allowed every round: where labels jump at a place, none is still for ever."""


@dataclass(frozen=True, slots=True, eq=False)
class Round:
    """What one round of finding, learning and solving left."""

    optimum: Optimum
    found: Found
    model: LinkModel
    labels: Labels
    """Of the ranges that were solved."""
    sides: Sides
    """Where the anchors' labels were taken."""
    held: int
    """So many factors hold anchors on their sides: the last ones of the fixed graph."""


def solve_joint(
    problem: GraphProblem, settings: GraphSettings, share: Share = alone
) -> GraphEstimate:
    """Solve poses, anchors and offsets together (Gaussian passes; iSAM2 where they end).

    Args:
        problem: matches that hold together, links, known places, a model of the links' errors.
        settings: see `GraphSettings`.
        share: how the search for the anchors is shared out.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
        SolverError: something is not determined or not finite.
    """
    if problem.link_model is None:
        raise SolverError("the joint solver needs a model of the links' errors")
    scene = Scene.of(problem, choose_start(problem), settings, share)
    scene, last = _solve_rounds(scene, problem.link_model)
    site = _site_by_ranges(scene, last.optimum.variables, last.found)
    if site is not None:
        scene, last = _solve_rounds(Scene.of(problem, site, settings, share), problem.link_model)
    return build_estimate(problem, _deliver(scene, last), settings)


def _solve_rounds(scene: Scene, model: LinkModel) -> tuple[Scene, Round]:
    """Find, learn and solve in turns until nothing moves; the scene with matches made honest."""
    # Poses by the matches alone first: chained ones are a poor place to look from.
    start = Variables(dict(scene.start.poses), {}, scene.prior.mean)
    matches = _match_factors(scene)
    alone = _solve(scene, matches, start, Found({}, {}), model, ())
    scene = _with_honest_matches(scene, matches, alone.optimum)
    # Made once: what follows solves them tens of times.
    matches = _match_factors(scene)
    last = _solve(scene, matches, alone.optimum.variables, alone.found, model, ())
    for number in range(MAX_ROUNDS):
        present = last.optimum.variables
        links = usable_links(scene.problem, present.poses, scene.settings)
        model, found, sides = last.model, last.found, last.sides
        if number <= LEARNING_ROUNDS:
            # In between, what was found has just been entered.
            if number != 1:
                model = model.at(present.poses)
            model = learn_links(scene, model, present, found, links, sides)
            if number == LEARNING_ROUNDS and (
                without := needs_no_offsets(scene, model, present, found, sides)
            ):
                model, prior = without
                scene = replace(scene, prior=prior)
            if number != 1:
                found = find_points(scene, model, present, links, found)
        begin = _enter(scene, present, found)
        if number in (0, LEARNING_ROUNDS):
            sides = likely_sides(scene, model, begin, found, links)
        last = _solve(scene, matches, begin, found, model, links, sides, last)
        still = STILL * 2.0 ** max(0, number - PATIENT_ROUNDS)
        if number > LEARNING_ROUNDS and _is_settled(present, last.optimum.variables, still):
            break
    return scene, last


def _is_settled(before: Variables, after: Variables, still: float = STILL) -> bool:
    """Whether a round moved nothing by more than `still`, m: nothing that the next one would look at."""
    same = (
        before.anchors.keys() == after.anchors.keys() and before.poses.keys() == after.poses.keys()
    )
    return same and movement(before, after) < still


def _with_honest_matches(
    scene: Scene, graph: gtsam.NonlinearFactorGraph, optimum: Optimum
) -> Scene:
    """The scene with the covariances of its matches scaled to how well the matches agree.

    Where more matches than needed disagree by more than their covariances say, these are too small:
    all are multiplied by the variance of unit weight (chi-square by degrees of freedom). They are
    never made smaller.
    """
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
    return Variables(poses, anchors, present.offset, present.delays)


def _solve(
    scene: Scene,
    matches: gtsam.NonlinearFactorGraph,
    start: Variables,
    found: Found,
    model: LinkModel,
    links: tuple[LinkMeasurement, ...],
    sides: Sides = NO_SIDES,
    before: Round | None = None,
) -> Round:
    """The optimum near `start`, with labels as of there; `before` is the last round."""
    lost = frozenset(start.poses.keys() - scene.start.poses.keys())
    table = build_range_table(scene.problem, links, start, found.heights(), scene.levers, lost)
    seen = replace(start, anchors=start.anchors | {n: side.place for n, side in sides.items()})
    told = model.labels(*table.ends(seen))
    # Sides stand still; stations that only ranges place have none, and take their labels along.
    labels = next_labels(told, before.labels if before is not None and lost else None)
    ranges = weigh_ranges(table, labels.used, model)
    fixed = _fixed_factors(scene, matches, start, model if len(table.measured) else None)
    indices = Indices.of(scene.problem)
    held = side_factors(sides, start, scene.start.headings, indices)
    for factor in held:
        fixed.push_back(factor)
    near = before is not None and _is_settled(before.optimum.variables, start)
    optimum = solve_by_passes(fixed, ranges, start, indices, scene.settings, near)
    return Round(optimum, found, model, labels, sides, len(held))


def _fixed_factors(
    scene: Scene,
    matches: gtsam.NonlinearFactorGraph,
    start: Variables,
    model: LinkModel | None,
) -> gtsam.NonlinearFactorGraph:
    """Matches and priors: all that does not depend on how long the ranges are."""
    graph, indices = gtsam.NonlinearFactorGraph(matches), Indices.of(scene.problem)
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
    if model is not None:
        graph.push_back(factors.offset_prior(scene.prior))
        for name in start.anchors:
            graph.push_back(factors.delay_prior(indices.anchors[name], model.anchor_sigma))
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


def _without_sides(last: Round) -> Optimum:
    """The optimum with nothing from the change of labels: a wall that is not there holds nothing."""
    problem = last.optimum.problem
    fixed = gtsam.NonlinearFactorGraph()
    for k in range(problem.fixed.size() - last.held):
        fixed.push_back(problem.fixed.at(k))
    return replace(last.optimum, problem=replace(problem, fixed=fixed))


def _deliver(scene: Scene, last: Round) -> Solved:
    """Covariances, biases and checks of the final linearisation."""
    problem, indices, optimum = scene.problem, Indices.of(scene.problem), last.optimum
    stations, anchors = joint_order(problem, optimum.variables)
    keys = [factors.X(indices.stations[name]) for name in stations]
    keys += [factors.L(indices.anchors[name]) for name in anchors]
    size = 3 * len(stations) + 2 * len(anchors)
    has_offset = optimum.values.exists(factors.OFFSET_KEY)
    if has_offset:
        keys += [factors.OFFSET_KEY, *(factors.D(indices.anchors[name]) for name in anchors)]
    covariance = dense_covariance(_without_sides(last), keys)
    # Beside the Hessian there are labels that are wrong and tails (joint study, 7), and matches that
    # share a scan.
    spread = np.ones(len(covariance))
    scanned = np.array([name not in last.found.stations for name in stations], dtype=bool)
    spread[: 3 * len(stations)][np.repeat(scanned, 3)] = np.sqrt(scene.settings.pose_inflation)
    spread[3 * len(stations) : size] = np.sqrt(scene.settings.anchor_inflation)
    covariance *= np.outer(spread, spread)
    biases: tuple[Bias, ...] = ()
    if has_offset:
        sigma = float(np.sqrt(covariance[size, size]))
        prior, mean = scene.prior, optimum.variables.offset
        biases = (Bias("range offset", mean, sigma, prior.mean, prior.sigma),)
    found = last.found
    if has_offset:
        found = add_tails(scene, last.model, optimum.variables, found, covariance)
    return Solved(
        start=scene.start,
        variables=optimum.variables,
        covariance=covariance[:size, :size],
        anchors=found.settled(optimum.variables, scene.settings.twin_distance_m),
        stations=found.stations,
        levers=scene.levers,
        biases=biases,
        checks=check_optimum(optimum, indices, scene.settings),
        verdicts=judge_links(
            scene,
            last.model,
            optimum.variables,
            last.sides,
            found,
            usable_links(problem, optimum.variables.poses, scene.settings),
        ),
    )
