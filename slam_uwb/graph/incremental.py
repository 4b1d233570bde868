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
from .ranges import RangeTable, WeighedRanges
from .variables import Indices, Variables, from_values, movement, to_values


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
) -> Optimum:
    """Minimum of the fixed factors and the costs of the ranges.

    Args:
        fixed: matches and priors.
        ranges: with the density of their errors.
        start: where to start.
        indices: of the problem.
        settings: passes and tolerance.

    Raises:
        SolverError: a variable is not determined, or something is not finite.
    """
    table = ranges.table
    isam = gtsam.ISAM2(_isam_parameters())
    values = to_values(start, indices, with_offset=len(table.measured) > 0)
    best, best_values, best_cost = start, values, _cost(fixed, ranges, start, values)
    trust, worse, slots, step = factors.WEAK_PLACE_SIGMA, True, list[int](), math.inf
    for passes in range(1, settings.max_passes + 1):
        fed = feed_ranges(ranges, best, best_values, indices, safe=worse)
        fed += _leashes(best, indices, table, trust)
        new = gtsam.NonlinearFactorGraph(fixed) if passes == 1 else gtsam.NonlinearFactorGraph()
        slots = _exchange(isam, slots, new, fed, values if passes == 1 else None, indices)
        estimate = isam.calculateEstimate()
        present = from_values(estimate, start, indices)
        cost, moved = _cost(fixed, ranges, present, estimate), movement(best, present)
        # Steps that grow where the cost changes by no more than it is rounded by swing about the optimum.
        gain, rounding = best_cost - cost, 1e-12 * (1.0 + abs(best_cost))
        worse = gain < -rounding or (gain < rounding and moved >= step)
        step = moved
        if not worse:
            best, best_values, best_cost = present, estimate, cost
        # On a short leash a small step says nothing.
        if moved < settings.tolerance_m and (worse or trust >= 0.1):
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


def feed_ranges(
    ranges: WeighedRanges, present: Variables, at: gtsam.Values, indices: Indices, safe: bool
) -> list[gtsam.NonlinearFactor]:
    """One linear factor a range that touches its cost at the present estimate.

    Args:
        ranges: with the density of their errors.
        present: the estimate.
        at: the same for GTSAM.
        indices: of the problem.
        safe: with a curvature that the cost nowhere exceeds.
    """
    table = ranges.table
    _, slopes, curvatures = ranges.touching(present, safe)
    roots = np.sqrt(curvatures)
    directions = table.directions(present) * roots[:, None]
    fed: list[gtsam.NonlinearFactor] = []
    for row, (root, slope) in enumerate(zip(roots, slopes, strict=True)):
        second = directions[row : row + 1]
        # d(pose) in the station's own axes: the direction turned, and the lever's arm.
        keys, first = _first_end(table, row, present, indices, second)
        keys[_second_key(table, row, indices)] = second
        keys[first] = np.array([[root]])
        fed.append(factors.linear_factor(keys, float(slope / root), at))
    return fed


def _first_end(
    table: RangeTable, row: int, present: Variables, indices: Indices, direction: FloatArray
) -> tuple[dict[int, FloatArray], int]:
    """The derivative by a range's first end, and the key of the offset that goes with it."""
    first, station_count = int(table.first[row]), len(table.stations)
    if first >= station_count:
        other = indices.anchors[table.anchors[first - station_count]]
        return {factors.L(other): -direction}, factors.OFFSET_KEY
    name = table.stations[first]
    along, across = direction[0] @ present.poses[name].rotation
    lever_x, lever_y = table.levers[first]
    block = np.array([[-along, -across, along * lever_y - across * lever_x]])
    anchor = indices.anchors[table.anchors[int(table.second[row]) - station_count]]
    return {factors.X(indices.stations[name]): block}, factors.D(anchor)


def _second_key(table: RangeTable, row: int, indices: Indices) -> int:
    return factors.L(indices.anchors[table.anchors[int(table.second[row]) - len(table.stations)]])


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


def _exchange(
    isam: gtsam.ISAM2,
    old_slots: list[int],
    new: gtsam.NonlinearFactorGraph,
    fed: list[gtsam.NonlinearFactor],
    values: gtsam.Values | None,
    indices: Indices,
) -> list[int]:
    """Replace the factors in the old slots by those fed, add new ones, take one step.

    Returns:
        The slots of the fed factors.
    """
    for factor in fed:
        new.push_back(factor)
    try:
        result = isam.update(new, gtsam.Values() if values is None else values, old_slots)
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
