"""A drawn graph of any size: stations in rows, matches with neighbours, links to the nearest anchors.

Solved twice from one start: by the package's passes, and by GTSAM's batch Levenberg-Marquardt on its
own C++ factors of the same matches and ranges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from slam_uwb.graph import factors
from slam_uwb.graph.incremental import solve_by_passes
from slam_uwb.graph.ranges import RangeTable, WeighedRanges
from slam_uwb.graph.variables import Indices, Variables
from slam_uwb.model.geometry import FloatArray, Pose2
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.survey import RangeOffset

SPACING_M, MATCH_SIGMA, TURN_SIGMA, RANGE_SIGMA_M = 2.0, 0.02, math.radians(0.5), 0.1
START_M, START_RAD = 0.2, math.radians(2.0)
FIXED = RangeOffset(0.0, 1e-4)
"""No delays: GTSAM's own range factors know of none."""


@dataclass(frozen=True)
class DrawnGraph:
    """Truth, measurements and start."""

    truth: Variables
    start: Variables
    matches: list[tuple[int, int, Pose2]]
    links: list[tuple[int, int, float]]


def draw_graph(stations: int, anchors: int, links: int, seed: int = 0) -> DrawnGraph:
    """A square of stations 2 m apart; each is matched with its neighbours to the right and above."""
    rng = np.random.default_rng(seed)
    side = math.ceil(math.sqrt(stations))
    cells = np.array([(k % side, k // side) for k in range(stations)])
    places = SPACING_M * cells + rng.normal(0.0, 0.3, (stations, 2))
    poses = [Pose2(x, y, t) for (x, y), t in zip(places, rng.uniform(-3, 3, stations), strict=True)]
    spots = rng.uniform(0.0, SPACING_M * side, (anchors, 2))
    noise = np.array([MATCH_SIGMA, MATCH_SIGMA, TURN_SIGMA])
    matches = [
        (k, n, poses[k].inverse() @ poses[n] @ Pose2(*rng.normal(0.0, noise)))
        for k in range(stations)
        for n in ([k + 1] if (k + 1) % side else []) + [k + side]
        if n < stations
    ]
    each = min(anchors, max(1, round(links / stations)))
    ranges = []
    for k, place in enumerate(places):
        away = np.hypot(*(spots - place).T)
        ranges += [
            (k, int(a), float(away[a] + rng.normal(0.0, RANGE_SIGMA_M)))
            for a in np.argsort(away)[:each]
        ]
    truth = Variables(
        {f"s{k}": pose for k, pose in enumerate(poses)},
        {f"a{k}": spot for k, spot in enumerate(spots)},
        0.0,
    )
    return DrawnGraph(truth, _spoiled(truth, rng), matches, ranges)


def _spoiled(truth: Variables, rng: np.random.Generator) -> Variables:
    """Within 0.2 m and 2 degrees of the truth; the first station stays, as it is the frame."""

    def off() -> FloatArray:
        return rng.uniform(-START_M, START_M, 2) / math.sqrt(2.0)

    poses = {
        name: Pose2(*(pose.translation + off()), pose.theta + rng.uniform(-START_RAD, START_RAD))
        for name, pose in truth.poses.items()
    }
    poses["s0"] = truth.poses["s0"]
    return Variables(poses, {name: spot + off() for name, spot in truth.anchors.items()}, 0.0)


def solve_ours(drawn: DrawnGraph) -> tuple[Variables, int]:
    """The optimum by the package's passes, and how many it took."""
    stations, anchors = list(drawn.truth.poses), list(drawn.truth.anchors)
    indices = Indices({n: k for k, n in enumerate(stations)}, {n: k for k, n in enumerate(anchors)})
    fixed = _matches(drawn, [factors.X(k) for k in range(len(stations))])
    fixed.push_back(factors.gauge_factor(0, drawn.truth.poses["s0"]))
    fixed.push_back(factors.offset_prior(FIXED))
    for k in range(len(anchors)):
        fixed.push_back(factors.delay_prior(k, FIXED.sigma))
    first, second, measured = (np.array(column) for column in zip(*drawn.links, strict=True))
    table = RangeTable(
        stations=tuple(stations),
        anchors=tuple(anchors),
        lost=frozenset(),
        levers=np.zeros((len(stations), 2)),
        first=first.astype(np.intp),
        second=second.astype(np.intp) + len(stations),
        measured=measured,
        sigmas=np.full(len(measured), RANGE_SIGMA_M),
        rises=np.zeros(len(measured)),
    )
    peak = RANGE_SIGMA_M**-2
    ranges = WeighedRanges(table, _Gaussian(len(measured)), (1e-3 * peak, peak))
    optimum = solve_by_passes(fixed, ranges, drawn.start, indices, GraphSettings())
    return optimum.variables, optimum.passes


def solve_batch(drawn: DrawnGraph) -> Variables:
    """The optimum by GTSAM's batch Levenberg-Marquardt."""
    stations, anchors = list(drawn.truth.poses), list(drawn.truth.anchors)
    keys = [factors.X(k) for k in range(len(stations))]
    graph = _matches(drawn, keys)
    graph.push_back(factors.gauge_factor(0, drawn.truth.poses["s0"]))
    noise = gtsam.noiseModel.Isotropic.Sigma(1, RANGE_SIGMA_M)
    for station, anchor, measured in drawn.links:
        graph.push_back(gtsam.RangeFactor2D(keys[station], factors.L(anchor), measured, noise))
    values = gtsam.Values()
    for key, name in zip(keys, stations, strict=True):
        values.insert(key, factors.to_gtsam(drawn.start.poses[name]))
    for k, name in enumerate(anchors):
        values.insert(factors.L(k), drawn.start.anchors[name])
    # GTSAM's own limits end a millimetre early.
    limits = gtsam.LevenbergMarquardtParams()
    limits.setRelativeErrorTol(1e-10)
    limits.setAbsoluteErrorTol(1e-10)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, limits).optimize()
    return replace(
        drawn.start,
        poses={
            n: factors.from_gtsam(found.atPose2(k)) for k, n in zip(keys, stations, strict=True)
        },
        anchors={n: found.atPoint2(factors.L(k)) for k, n in enumerate(anchors)},
    )


def gap_m(a: Variables, b: Variables) -> float:
    """m, the furthest that two solutions are apart anywhere."""
    poses = [pose.distance_to(b.poses[name]) for name, pose in a.poses.items()]
    return max(poses + [math.dist(spot, b.anchors[name]) for name, spot in a.anchors.items()])


def _matches(drawn: DrawnGraph, keys: list[int]) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([MATCH_SIGMA, MATCH_SIGMA, TURN_SIGMA]))
    for target, source, pose in drawn.matches:
        measured = factors.to_gtsam(pose)
        graph.push_back(gtsam.BetweenFactorPose2(keys[target], keys[source], measured, noise))
    return graph


@dataclass(frozen=True)
class _Gaussian:
    """Errors of ranges in line of sight, as `LinkDensity`."""

    count: int

    @property
    def weights(self) -> FloatArray:
        return np.ones(self.count)

    def costs(self, errors: FloatArray, /) -> FloatArray:
        return 0.5 * (errors / RANGE_SIGMA_M) ** 2

    def expand(self, errors: FloatArray, /) -> tuple[FloatArray, FloatArray, FloatArray]:
        peak = RANGE_SIGMA_M**-2
        return self.costs(errors), errors * peak, np.full(len(errors), peak)

    def posterior(self, errors: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        return np.ones((len(errors), 1)), np.zeros(len(errors))
