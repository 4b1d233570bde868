"""The joint problem, solved by passes: look at the residuals outside, solve with Gaussians, repeat.

A pass replaces each range by the Gaussian that touches its cost at the best estimate so far: same
slope, a curvature that is never negative. Where a pass made the total cost worse, the next one uses the
curvature of line of sight, which no cost exceeds (every density is a Gaussian convolved with something:
the step is that of expectation-maximisation), and a shorter leash. Everything moves in a pass, so it
eliminates everything at once: iSAM2 would do no less, at three times the price. The iSAM2 problem is what
the passes end at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import gtsam
import numpy as np

from ..model.geometry import FloatArray
from ..model.settings import GraphSettings
from . import factors
from .feeding import anchor_bends
from .ranges import RangeTable, WeighedRanges
from .steps import Estimate, Problem, solve_linear, solver_error
from .variables import Indices, Variables, from_values

_SILENT_PASSES = 4
"""A cost that so often changed by no more than it is rounded by has nothing more to say."""
_SHORT_M, _SHORT_SAFE_M = 1e-5, 1e-3
"""m and rad. A step so short that gains nothing is rounding, and a safe one, which gains wherever there is
anything to gain, already when it is longer: of matches that are turned against each other by some 1e-5 rad
GTSAM knows the derivatives to a few digits only, and steps do not become shorter for ever."""


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """A solved problem."""

    variables: Variables
    passes: int
    cost: float
    """Negative log likelihood: half the squared whitened residuals, the density's for the ranges."""
    problem: Problem
    estimate: Estimate
    """The variables, and what everything costs there."""

    @property
    def values(self) -> gtsam.Values:
        """The variables as GTSAM has them."""
        return self.estimate.values

    @property
    def graph(self) -> gtsam.NonlinearFactorGraph:
        """Matches, priors, and exact ranges whose Gaussians touch the costs at the optimum.

        Made when it is asked for: each range is a callback into Python, exact wherever its ends are.
        """
        problem, here = self.problem, self.estimate
        graph, table = gtsam.NonlinearFactorGraph(problem.fixed), problem.ranges.table
        curvatures = problem.ranges.let_in(here.ranges, safe=False)
        measured = table.measured - here.ranges.spans.residuals + here.ranges.slopes / curvatures
        sigmas = 1.0 / np.sqrt(curvatures)
        for row, (m, sigma) in enumerate(zip(measured, sigmas, strict=True)):
            graph.push_back(_range_factor(table, problem.indices, row, float(m), float(sigma)))
        for leash in _leashes(self.variables, problem.indices, table):
            graph.push_back(leash)
        return graph


def solve_by_passes(
    fixed: gtsam.NonlinearFactorGraph,
    ranges: WeighedRanges,
    start: Variables,
    indices: Indices,
    settings: GraphSettings,
    near: bool = False,
) -> Optimum:
    """Minimum of the fixed factors and the costs of the ranges.

    Args:
        fixed: matches and priors.
        ranges: with the density of their errors.
        start: where to start.
        indices: of the problem.
        settings: passes and tolerance.
        near: whether the start is where nearly the same problem ended: no careful first step then.

    Raises:
        SolverError: a variable is not determined, or something is not finite.
    """
    problem = Problem.of(fixed, ranges, start, indices)
    best = problem.start(start)
    trust, worse, step, order = factors.WEAK_PLACE_SIGMA, not near, math.inf, None
    bent, passes, silent = True, 0, 0
    while passes < settings.max_passes:
        passes += 1
        short = _SHORT_SAFE_M if worse else _SHORT_M
        linear = problem.linear(best, trust, safe=worse)
        order = order or gtsam.Ordering.ColamdGaussianFactorGraph(linear)
        bends = anchor_bends(ranges, best.ranges, indices) if bent and not worse else []
        delta, bent = solve_linear(linear, bends, order, indices)
        present = problem.at(best.values.retract(delta))
        moved = best.places.movement(present.places)
        # Steps that grow where the cost changes by no more than it is rounded by swing about the optimum.
        gain, rounding = best.cost - present.cost, 1e-11 * (1.0 + abs(best.cost))
        worse = gain < -rounding or (gain < rounding and moved >= step)
        silent = silent + 1 if abs(gain) < rounding else 0
        step = moved
        if not worse:
            best = present
        still = moved < settings.tolerance_m or (moved < short and gain < rounding)
        # On a short leash a small step says nothing.
        if (still and (worse or trust >= 0.1)) or silent == _SILENT_PASSES:
            break
        trust = min(1.0, trust) / 3.0 if worse else min(factors.WEAK_PLACE_SIGMA, 2.0 * trust)
    return Optimum(from_values(best.values, start, indices), passes, best.cost, problem, best)


def incremental_problem(optimum: Optimum) -> gtsam.ISAM2:
    """The iSAM2 problem of all poses, anchors and offsets at the optimum.

    Its marginals are those of the last linearisation; stations and links can be added to it.
    """
    problem, estimate = optimum.problem, optimum.estimate
    ranges = problem.linear_ranges(estimate, factors.WEAK_PLACE_SIGMA, safe=False)
    graph = gtsam.LinearContainerFactor.ConvertLinearGraph(ranges, estimate.values)
    graph.push_back(problem.fixed)
    isam = gtsam.ISAM2(_isam_parameters())
    try:
        isam.update(graph, estimate.values)
    except RuntimeError as error:
        raise solver_error(error, problem.indices) from error
    return isam


def _isam_parameters() -> gtsam.ISAM2Params:
    # The defaults (every 10th update, threshold 0.1, wildfire 1e-3) stop up to 95 mm short.
    step = gtsam.ISAM2GaussNewtonParams()
    step.setWildfireThreshold(1e-10)
    parameters = gtsam.ISAM2Params()
    parameters.setOptimizationParams(step)
    parameters.relinearizeSkip = 1
    parameters.setRelinearizeThreshold(1e-8)
    return parameters


def _leashes(
    present: Variables, indices: Indices, table: RangeTable
) -> list[gtsam.NonlinearFactor]:
    """Weak priors at the present place of what only ranges hold."""
    weak = factors.WEAK_PLACE_SIGMA
    leashes: list[gtsam.NonlinearFactor] = [
        factors.anchor_prior(indices.anchors[name], place, weak)
        for name, place in present.anchors.items()
    ]
    lost = [name for name in present.poses if name in table.lost]
    return leashes + [
        factors.station_prior(indices.stations[name], present.poses[name].translation, weak)
        for name in lost
    ]


def _range_factor(
    table: RangeTable, indices: Indices, row: int, measured: float, sigma: float
) -> gtsam.CustomFactor:
    """The range itself, exact wherever its ends are."""
    first, second, station_count = (
        int(table.first[row]),
        int(table.second[row]),
        len(table.stations),
    )
    rise = float(table.rises[row])
    anchor = indices.anchors[table.anchors[second - station_count]]
    if first >= station_count:
        other = indices.anchors[table.anchors[first - station_count]]
        return factors.anchor_range_factor(other, anchor, measured, sigma, rise)
    station = indices.stations[table.stations[first]]
    lever = table.levers[first]
    return factors.slant_range_factor(station, anchor, measured, sigma, lever, rise)


def dense_covariance(optimum: Optimum, keys: list[int]) -> FloatArray:
    """Joint covariance of all variables, in the order of `keys`, which must be all of them.

    Poses in their own axes, (x, y, theta). It is the inverse Hessian of the final linearisation, as
    gtsam.Marginals computes, in one step.
    """
    ordering = gtsam.Ordering()
    for key in keys:
        ordering.push_back(key)
    linear = optimum.problem.linear(optimum.estimate, factors.WEAK_PLACE_SIGMA, safe=False)
    hessian, _ = linear.hessian(ordering)
    # Scaled to a unit diagonal: the gauge's 1e12 beside an anchor's 1e-4 would cost all digits.
    scale = 1.0 / np.sqrt(np.diag(hessian))
    covariance = np.linalg.inv(hessian * np.outer(scale, scale)) * np.outer(scale, scale)
    return np.asarray((covariance + covariance.T) / 2.0)
