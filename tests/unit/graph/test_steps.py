"""Passes end where GTSAM's own batch optimiser ends, whatever ranges depend on."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import gtsam
import numpy as np
import pytest

from slam_uwb.graph import factors
from slam_uwb.graph.incremental import incremental_problem, solve_by_passes
from slam_uwb.graph.ranges import RangeTable, WeighedRanges
from slam_uwb.graph.steps import Problem, solve_linear
from slam_uwb.graph.variables import Indices, Places, Variables, from_values, to_values
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.survey import RangeOffset

SETTINGS = GraphSettings()
SIGMA_M = 0.1
PRIOR, OWN_SIGMA = RangeOffset(0.2, 0.1), 0.05
MATCH_SIGMAS = np.array([0.02, 0.02, 0.01])


@dataclass(frozen=True)
class Gaussian:
    """Errors of ranges that are all alike."""

    count: int

    @property
    def weights(self):
        return np.ones(self.count)

    def costs(self, errors):
        return 0.5 * (errors / SIGMA_M) ** 2

    def expand(self, errors):
        peak = SIGMA_M**-2
        return self.costs(errors), errors * peak, np.full(len(errors), peak)


@dataclass(frozen=True)
class Drawn:
    """A graph, once as the passes are given it and once as GTSAM's own factors."""

    fixed: gtsam.NonlinearFactorGraph
    ranges: WeighedRanges
    exact: gtsam.NonlinearFactorGraph
    start: Variables
    indices: Indices


def draw(seed, side=4, anchors=4):
    """Stations on a square, tags beside their scanners, anchors that are higher and measure each other.

    One station is held by nothing but its ranges. All names come in another order than their keys.
    """
    rng = np.random.default_rng(seed)
    count = side * side
    poses = [
        Pose2(3.0 * (k % side), 3.0 * (k // side), rng.uniform(-3, 3) if k else 0.0)
        for k in range(count)
    ]
    spots = rng.uniform(0.0, 3.0 * side, (anchors, 2))
    lost = count - 1
    poses[lost] = Pose2(poses[lost].x, poses[lost].y, 0.0)
    fixed = gtsam.NonlinearFactorGraph()
    fixed.push_back(factors.gauge_factor(0, poses[0]))
    fixed.push_back(factors.heading_factor(lost, 0.0, 1e-3))
    noise = gtsam.noiseModel.Diagonal.Sigmas(MATCH_SIGMAS)
    for k in range(lost):
        for n in ([k + 1] if (k + 1) % side else []) + [k + side]:
            if n < lost:
                found = poses[k].inverse() @ poses[n] @ Pose2(*rng.normal(0.0, MATCH_SIGMAS))
                match = factors.X(k), factors.X(n), factors.to_gtsam(found), noise
                fixed.push_back(gtsam.BetweenFactorPose2(*match))
    fixed.push_back(factors.offset_prior(PRIOR))
    for a in range(anchors):
        fixed.push_back(factors.delay_prior(a, OWN_SIGMA))
    truth = Variables(
        {f"s{k}": poses[k] for k in rng.permutation(count)},
        {f"a{k}": spots[k] for k in rng.permutation(anchors)},
        0.25,
        {f"a{k}": rng.normal(0.0, OWN_SIGMA) for k in range(anchors)},
    )
    table = draw_ranges(rng, truth)
    indices = Indices({f"s{k}": k for k in range(count)}, {f"a{k}": k for k in range(anchors)})
    exact = gtsam.NonlinearFactorGraph(fixed)
    for row in range(len(table.measured)):
        exact.push_back(exact_factor(table, indices, row))
    peak = SIGMA_M**-2
    ranges = WeighedRanges(table, Gaussian(len(table.measured)), (0.02 * peak, peak))
    return Drawn(fixed, ranges, exact, spoiled(rng, truth), indices)


def draw_ranges(rng, truth):
    """Every tag to every anchor, and the first anchor to the others."""
    stations, anchors = tuple(truth.poses), tuple(truth.anchors)
    count = len(stations)
    ends = [(s, count + a) for s in range(count) for a in range(len(anchors))]
    ends += [(count, count + a) for a in range(1, len(anchors))]
    first, second = np.array(ends).T
    table = RangeTable(
        stations=stations,
        anchors=anchors,
        lost=frozenset({f"s{count - 1}"}),
        levers=rng.uniform(-0.3, 0.3, (count, 2)),
        first=first,
        second=second,
        measured=np.zeros(len(ends)),
        sigmas=np.full(len(ends), SIGMA_M),
        rises=rng.uniform(-0.5, 2.0, len(ends)),
    )
    errors = rng.normal(0.0, SIGMA_M, len(ends))
    return replace(table, measured=errors - table.residuals(truth))


def exact_factor(table, indices, row):
    first, second = table.first[row], table.second[row]
    count = len(table.stations)
    measured, rise = float(table.measured[row]), float(table.rises[row])
    anchor = indices.anchors[table.anchors[second - count]]
    if first >= count:
        other = indices.anchors[table.anchors[first - count]]
        return factors.anchor_range_factor(other, anchor, measured, SIGMA_M, rise)
    station = indices.stations[table.stations[first]]
    lever = table.levers[first]
    return factors.slant_range_factor(station, anchor, measured, SIGMA_M, lever, rise)


def spoiled(rng, truth):
    """Within 0.2 m and 2 degrees; no offset is known."""

    def off():
        return rng.uniform(-0.2, 0.2, 2) / math.sqrt(2.0)

    poses = {
        name: Pose2(*(pose.translation + off()), pose.theta + rng.uniform(-0.035, 0.035))
        for name, pose in truth.poses.items()
    }
    poses["s0"] = truth.poses["s0"]
    return Variables(poses, {name: spot + off() for name, spot in truth.anchors.items()}, 0.0)


def solve(drawn, settings=SETTINGS):
    return solve_by_passes(drawn.fixed, drawn.ranges, drawn.start, drawn.indices, settings)


def batch(drawn):
    limits = gtsam.LevenbergMarquardtParams()
    limits.setRelativeErrorTol(1e-14)
    limits.setAbsoluteErrorTol(1e-14)
    values = to_values(drawn.start, drawn.indices, with_offset=True)
    found = gtsam.LevenbergMarquardtOptimizer(drawn.exact, values, limits).optimize()
    return from_values(found, drawn.start, drawn.indices)


def gap(one, other):
    """Largest difference of any coordinate, angle, offset or delay."""
    gaps = [np.abs(pose.vector - other.poses[n].vector).max() for n, pose in one.poses.items()]
    gaps += [np.abs(spot - other.anchors[n]).max() for n, spot in one.anchors.items()]
    gaps += [abs(one.offset_of(n) - other.offset_of(n)) for n in one.anchors]
    return max(*gaps, abs(one.offset - other.offset))


@pytest.mark.parametrize("seed", range(5))
def test_passes_end_where_the_batch_optimiser_ends(seed):
    drawn = draw(seed)

    optimum = solve(drawn)

    assert gap(optimum.variables, batch(drawn)) < 1e-6
    # The delays are not nothing: they were free.
    assert max(abs(d) for d in optimum.variables.delays.values()) > 0.01


@pytest.mark.parametrize("seed", range(5))
def test_gaussian_errors_take_a_handful_of_passes(seed):
    # Gauss's steps square the distance: 0.2 m, centimetres, 0.1 mm, nothing.
    assert solve(draw(seed)).passes <= 6


def test_the_isam2_problem_is_at_the_optimum_and_has_its_marginals():
    drawn = draw(0)
    optimum = solve(drawn)

    isam = incremental_problem(optimum)

    end = from_values(isam.calculateEstimate(), drawn.start, drawn.indices)
    assert gap(optimum.variables, end) < 1e-6
    marginals = gtsam.Marginals(optimum.graph, optimum.values)
    for key in (factors.X(3), factors.L(2), factors.D(1), factors.OFFSET_KEY):
        np.testing.assert_allclose(
            isam.marginalCovariance(key), marginals.marginalCovariance(key), rtol=1e-5, atol=1e-14
        )


def test_the_isam2_problem_takes_a_new_station():
    drawn = draw(1)
    optimum = solve(drawn)
    isam = incremental_problem(optimum)
    station, step = factors.X(len(drawn.start.poses)), gtsam.Pose2(1.0, 0.5, 0.3)
    beside = optimum.values.atPose2(factors.X(5))
    new, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Diagonal.Sigmas(MATCH_SIGMAS)
    new.push_back(gtsam.BetweenFactorPose2(factors.X(5), station, step, noise))
    values.insert(station, gtsam.Pose2())

    isam.update(new, values)

    for _ in range(3):
        isam.update()
    # Nothing speaks against the only match that it has.
    assert isam.calculateEstimatePose2(station).equals(beside.compose(step), 1e-6)


def test_a_linear_problem_has_the_cost_s_own_slope():
    drawn = draw(2)
    problem = Problem.of(drawn.fixed, drawn.ranges, drawn.start, drawn.indices)
    here, h = problem.start(drawn.start), 1e-6
    gradient = problem.linear(here, trust=100.0, safe=False).gradientAtZero()
    for key in (factors.X(4), factors.X(15), factors.L(0), factors.D(3), factors.OFFSET_KEY):
        slopes = gradient.at(key)
        for axis, slope in enumerate(slopes):
            costs = []
            for size in (h, -h):
                # A small step in the variable's own axes.
                delta, step = here.values.zeroVectors(), gtsam.VectorValues()
                step.insert(key, size * np.eye(len(slopes))[axis])
                delta.update(step)
                costs.append(problem.at(here.values.retract(delta)).cost)
            assert slope == pytest.approx((costs[0] - costs[1]) / (2 * h), rel=1e-3, abs=1e-2)


def diagonal(linear, key):
    """Information of a variable by itself."""
    ordering = gtsam.Ordering.ColamdGaussianFactorGraph(linear)
    keys = [ordering.at(k) for k in range(ordering.size())]
    sizes = [{"x": 3, "l": 2, "d": 1, "b": 1}[chr(gtsam.symbolChr(k))] for k in keys]
    first = sum(sizes[: keys.index(key)])
    hessian, _ = linear.hessian(ordering)
    return np.diag(hessian)[first : first + sizes[keys.index(key)]]


def test_what_only_ranges_hold_is_on_a_leash():
    drawn = draw(3)
    problem = Problem.of(drawn.fixed, drawn.ranges, drawn.start, drawn.indices)
    here = problem.start(drawn.start)
    loose, tight = (problem.linear(here, trust, safe=False) for trust in (1.0, 0.5))

    # 1/m^2 more of half the sigma, at anchors and at the places of lost stations alone.
    for key, more in (
        (factors.L(1), [3.0, 3.0]),
        (factors.X(15), [3.0, 3.0, 0.0]),
        (factors.X(14), [0.0, 0.0, 0.0]),
        (factors.D(1), [0.0]),
    ):
        np.testing.assert_allclose(diagonal(tight, key) - diagonal(loose, key), more, atol=1e-6)


@pytest.mark.parametrize(("curvature", "place", "kept"), [(1.0, 0.5, True), (-2.0, 1.0, False)])
def test_bends_are_left_out_where_the_problem_would_not_be_definite(curvature, place, kept):
    linear = gtsam.GaussianFactorGraph()
    linear.add(factors.L(0), np.eye(2), np.ones(2), gtsam.noiseModel.Unit.Create(2))
    linear.add(factors.D(0), np.eye(1), np.ones(1), gtsam.noiseModel.Unit.Create(1))
    ordering = gtsam.Ordering.ColamdGaussianFactorGraph(linear)
    bend = factors.curvature_factor(0, curvature * np.eye(3))

    delta, bent = solve_linear(linear, [bend], ordering, Indices({}, {"A": 0}))

    assert bent is kept
    np.testing.assert_allclose(delta.at(factors.L(0)), [place, place])


def test_movement_is_the_furthest_of_anything():
    here = Places(np.array([[0.0, 0.0, math.pi - 0.01]]), np.zeros((1, 2)), np.zeros(2))

    turned = replace(here, poses=np.array([[0.0, 0.0, 0.01 - math.pi]]))
    moved = replace(here, poses=here.poses + [0.3, 0.4, 0.0])
    assert here.movement(turned) == pytest.approx(0.02)
    assert here.movement(moved) == pytest.approx(0.5)
    assert here.movement(replace(here, anchors=np.array([[0.3, -0.4]]))) == pytest.approx(0.5)
    # The common offset; the anchors' own ones follow their places.
    assert here.movement(replace(here, offsets=np.array([0.2, 0.1]))) == pytest.approx(0.1)
