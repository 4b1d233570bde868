"""One iSAM2 problem, solved by passes: look at the residuals outside, feed Gaussian factors, repeat.

A pass replaces each range factor by the Gaussian that touches its cost at the best estimate so far:
same slope, a curvature that is never negative. Where a pass made the total cost worse, the next one
uses the curvature of line of sight, which no cost exceeds (every density is a Gaussian convolved with
something: the step is that of expectation-maximisation), and a shorter leash.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import gtsam
import numpy as np

from ..model.errors import SolverError
from ..model.geometry import FloatArray
from ..model.settings import GraphSettings
from . import factors
from .feeding import anchor_bends, feed_ranges
from .ranges import RangeTable, WeighedRanges
from .variables import Indices, Variables, from_values, movement, to_values

# A cost that so often changed by no more than it is rounded by has nothing more to say.
_SILENT_PASSES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """A solved graph."""

    variables: Variables
    graph: gtsam.NonlinearFactorGraph
    values: gtsam.Values
    passes: int
    cost: float
    """Negative log likelihood: half the squared whitened residuals, the density's for the ranges."""
    fixed: gtsam.NonlinearFactorGraph
    """Matches and priors."""
    ranges: WeighedRanges


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
    table = ranges.table
    isam = gtsam.ISAM2(_isam_parameters())
    values = to_values(start, indices, with_offset=len(table.measured) > 0)
    best, best_values, best_cost = start, values, _cost(fixed, ranges, start, values)
    trust, worse, slots, step = factors.WEAK_PLACE_SIGMA, not near, list[int](), math.inf
    bent, silent = True, 0
    for passes in range(1, settings.max_passes + 1):
        fed = feed_ranges(ranges, best, best_values, indices, safe=worse)
        fed += _leashes(best, indices, table, trust)
        bends = anchor_bends(ranges, best, best_values, indices) if bent and not worse else []
        new = (fixed, values) if passes == 1 else (gtsam.NonlinearFactorGraph(), gtsam.Values())
        isam, slots, bent = _advance(isam, slots, new, fed, bends, indices)
        estimate = isam.calculateEstimate()
        present = from_values(estimate, start, indices)
        cost, moved = _cost(fixed, ranges, present, estimate), movement(best, present)
        # Steps that grow where the cost changes by no more than it is rounded by swing about the optimum.
        gain, rounding = best_cost - cost, 1e-11 * (1.0 + abs(best_cost))
        worse = gain < -rounding or (gain < rounding and moved >= step)
        silent = silent + 1 if abs(gain) < rounding else 0
        step = moved
        if not worse:
            best, best_values, best_cost = present, estimate, cost
        # On a short leash a small step says nothing.
        if moved < settings.tolerance_m and (worse or trust >= 0.1):
            break
        if silent == _SILENT_PASSES:
            break
        trust = min(1.0, trust) / 3.0 if worse else min(factors.WEAK_PLACE_SIGMA, 2.0 * trust)
    return _finish(fixed, ranges, best, indices, passes)


def _leashes(
    present: Variables, indices: Indices, table: RangeTable, trust: float
) -> list[gtsam.NonlinearFactor]:
    """Priors at the present place of what only ranges hold: the damping that iSAM2 does not have.

    They follow the estimate, so they bend no result. An anchor near the line of its stations needs
    them: Gauss-Newton jumps across the line for ever.
    """
    leashes: list[gtsam.NonlinearFactor] = [
        factors.anchor_prior(indices.anchors[name], place, trust)
        for name, place in present.anchors.items()
    ]
    lost = [name for name in present.poses if name in table.lost]
    return leashes + [
        factors.station_prior(indices.stations[name], present.poses[name].translation, trust)
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


def _isam_parameters() -> gtsam.ISAM2Params:
    # The defaults (every 10th update, threshold 0.1, wildfire 1e-3) stop up to 95 mm short.
    step = gtsam.ISAM2GaussNewtonParams()
    step.setWildfireThreshold(1e-10)
    parameters = gtsam.ISAM2Params()
    parameters.setOptimizationParams(step)
    parameters.relinearizeSkip = 1
    parameters.setRelinearizeThreshold(1e-8)
    return parameters


def _advance(
    isam: gtsam.ISAM2,
    old_slots: list[int],
    new: tuple[gtsam.NonlinearFactorGraph, gtsam.Values],
    fed: list[gtsam.NonlinearFactor],
    bends: list[gtsam.NonlinearFactor],
    indices: Indices,
) -> tuple[gtsam.ISAM2, list[int], bool]:
    """One step, with the bends where they leave the problem definite.

    Returns:
        What has taken the step, the slots of the fed factors, and whether bends are of use.
    """
    if bends:
        # What iSAM2 is after a failure is not known.
        spare = gtsam.ISAM2(isam)
        try:
            return isam, _exchange(isam, old_slots, new, [*fed, *bends], indices), True
        except SolverError:
            # An anchor is held only as well as the poses that see it.
            isam = spare
    return isam, _exchange(isam, old_slots, new, fed, indices), not bends


def _exchange(
    isam: gtsam.ISAM2,
    old_slots: list[int],
    new: tuple[gtsam.NonlinearFactorGraph, gtsam.Values],
    fed: list[gtsam.NonlinearFactor],
    indices: Indices,
) -> list[int]:
    """Replace the factors in the old slots by those fed, add new ones, take one step.

    Returns:
        The slots of the fed factors.
    """
    graph, values = gtsam.NonlinearFactorGraph(new[0]), new[1]
    for factor in fed:
        graph.push_back(factor)
    try:
        result = isam.update(graph, values, old_slots)
    except RuntimeError as error:
        raise solver_error(error, indices) from error
    slots = list(result.getNewFactorsIndices())
    return slots[len(slots) - len(fed) :]


def solver_error(error: RuntimeError, indices: Indices) -> SolverError:
    """GTSAM's complaint in the words of the survey."""
    symbol = re.search(r"Symbol: ([xlbd]\d+)", str(error))
    if "Indeterminate" in str(error) and symbol:
        name = indices.name(symbol[1])
        return SolverError(f"the measurements do not determine {name}")
    return SolverError(f"the solver failed: {error}")


def _finish(
    fixed: gtsam.NonlinearFactorGraph,
    ranges: WeighedRanges,
    best: Variables,
    indices: Indices,
    passes: int,
) -> Optimum:
    """The graph whose factors touch all costs at the optimum, the ranges as exact factors."""
    table = ranges.table
    graph = gtsam.NonlinearFactorGraph(fixed)
    residuals, slopes, curvatures = ranges.touching(best, safe=False)
    measured = table.measured - residuals + slopes / curvatures
    sigmas = 1.0 / np.sqrt(curvatures)
    for row, (m, sigma) in enumerate(zip(measured, sigmas, strict=True)):
        graph.push_back(_range_factor(table, indices, row, float(m), float(sigma)))
    for leash in _leashes(best, indices, table, factors.WEAK_PLACE_SIGMA):
        graph.push_back(leash)
    values = to_values(best, indices, with_offset=len(table.measured) > 0)
    cost = _cost(fixed, ranges, best, values)
    return Optimum(best, graph, values, passes, cost, fixed, ranges)


def dense_covariance(optimum: Optimum, keys: list[int]) -> FloatArray:
    """Joint covariance of all variables, in the order of `keys`, which must be all of them.

    Poses in their own axes, (x, y, theta). It is the inverse Hessian of the final linearisation, as
    gtsam.Marginals computes, in one step.
    """
    ordering = gtsam.Ordering()
    for key in keys:
        ordering.push_back(key)
    hessian, _ = optimum.graph.linearize(optimum.values).hessian(ordering)
    # Scaled to a unit diagonal: the gauge's 1e12 beside an anchor's 1e-4 would cost all digits.
    scale = 1.0 / np.sqrt(np.diag(hessian))
    covariance = np.linalg.inv(hessian * np.outer(scale, scale)) * np.outer(scale, scale)
    return np.asarray((covariance + covariance.T) / 2.0)


def _cost(
    fixed: gtsam.NonlinearFactorGraph,
    ranges: WeighedRanges,
    variables: Variables,
    values: gtsam.Values,
) -> float:
    """Negative log likelihood of the fixed factors and the ranges."""
    costs = ranges.density.costs(ranges.table.residuals(variables))
    cost = float(fixed.error(values) + costs.sum())
    # GTSAM returns its start without complaint where a measurement is not a number.
    if not math.isfinite(cost):
        raise SolverError("the cost is not finite: a match, range or prior is not a number")
    return cost
