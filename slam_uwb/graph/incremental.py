"""One iSAM2 problem, solved by passes: look at the residuals outside, feed Gaussian factors, repeat.

A pass replaces each range factor by the Gaussian that touches its loss at the best estimate so far:
same slope, a curvature that is never negative. Where a pass made the total cost worse, the next one
uses the larger curvature of re-weighted least squares and a shorter leash.
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
from .losses import one_sided_cost, one_sided_curvature, one_sided_weight
from .ranges import RangeTable
from .variables import Indices, Variables, from_values, movement, to_values

CURVATURE_FLOOR = 0.25
"""Least curvature as a share of re-weighting's."""


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """A solved graph."""

    variables: Variables
    graph: gtsam.NonlinearFactorGraph
    values: gtsam.Values
    passes: int
    cost: float
    """Negative log likelihood: half the squared whitened residuals, the losses for the ranges."""


def solve_by_passes(
    fixed: gtsam.NonlinearFactorGraph,
    table: RangeTable,
    start: Variables,
    indices: Indices,
    settings: GraphSettings,
) -> Optimum:
    """Minimum of the fixed factors and the one-sided range costs.

    Args:
        fixed: matches and priors.
        table: the ranges.
        start: where to start.
        indices: of the problem.
        settings: passes, tolerance, scale of the loss.

    Raises:
        SolverError: a variable is not determined, or something is not finite.
    """
    isam = gtsam.ISAM2(_isam_parameters())
    values = to_values(start, indices, with_offset=len(table.measured) > 0)
    best, best_cost = start, _cost(fixed, table, start, values, settings)
    trust, worse, slots = factors.WEAK_PLACE_SIGMA, True, list[int]()
    for passes in range(1, settings.max_passes + 1):
        fed = feed_ranges(table, best, indices, settings, safe=worse)
        fed += _leashes(best, indices, table, trust)
        new = gtsam.NonlinearFactorGraph(fixed) if passes == 1 else gtsam.NonlinearFactorGraph()
        slots = _exchange(isam, slots, new, fed, values if passes == 1 else None, indices)
        estimate = isam.calculateEstimate()
        present = from_values(estimate, start, indices)
        cost, moved = _cost(fixed, table, present, estimate, settings), movement(best, present)
        worse = cost > best_cost + 1e-12 * (1.0 + best_cost)
        if not worse:
            best, best_cost = present, cost
        # On a short leash a small step says nothing.
        if moved < settings.tolerance_m and (worse or trust >= 0.1):
            break
        trust = min(1.0, trust) / 3.0 if worse else min(factors.WEAK_PLACE_SIGMA, 2.0 * trust)
    return _finish(fixed, table, best, indices, settings, passes)


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
    table: RangeTable, present: Variables, indices: Indices, settings: GraphSettings, safe: bool
) -> list[gtsam.NonlinearFactor]:
    """One Gaussian factor a range that touches its loss at the present estimate.

    With slope g and curvature c of the loss, the factor measures predicted + offset + g / c with
    sigma 1 / sqrt(c); with c of re-weighting (`safe`) that is the measured range itself.
    """
    residuals = table.residuals(present)
    weights = one_sided_weight(residuals, table.sigmas, settings.nlos_scale)
    curvatures = weights
    if not safe:
        exact = one_sided_curvature(residuals, table.sigmas, settings.nlos_scale)
        curvatures = np.maximum(exact, CURVATURE_FLOOR * weights)
    measured = table.measured - residuals * (1.0 - weights / curvatures)
    sigmas = table.sigmas / np.sqrt(curvatures)
    station_count = len(table.stations)
    return [
        _range_factor(table, indices, row, station_count, measured=float(m), sigma=float(s))
        for row, (m, s) in enumerate(zip(measured, sigmas, strict=True))
    ]


def _range_factor(
    table: RangeTable, indices: Indices, row: int, station_count: int, measured: float, sigma: float
) -> gtsam.CustomFactor:
    first, second = int(table.first[row]), int(table.second[row])
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
    symbol = re.search(r"Symbol: ([xlb]\d+)", str(error))
    if "Indeterminate" in str(error) and symbol:
        name = indices.name(symbol[1])
        return SolverError(f"the measurements do not determine {name}")
    return SolverError(f"the solver failed: {error}")


def _finish(
    fixed: gtsam.NonlinearFactorGraph,
    table: RangeTable,
    best: Variables,
    indices: Indices,
    settings: GraphSettings,
    passes: int,
) -> Optimum:
    """The graph whose factors touch all losses at the optimum."""
    graph = gtsam.NonlinearFactorGraph(fixed)
    fed = feed_ranges(table, best, indices, settings, safe=False)
    for factor in fed + _leashes(best, indices, table, factors.WEAK_PLACE_SIGMA):
        graph.push_back(factor)
    values = to_values(best, indices, with_offset=len(table.measured) > 0)
    return Optimum(best, graph, values, passes, _cost(fixed, table, best, values, settings))


def batch_gap(optimum: Optimum, indices: Indices) -> float:
    """m, how far batch Levenberg-Marquardt on the same graph ends from the optimum."""
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-12)
    parameters.setAbsoluteErrorTol(1e-12)
    batch = gtsam.LevenbergMarquardtOptimizer(optimum.graph, optimum.values, parameters).optimize()
    other = from_values(batch, optimum.variables, indices)
    gaps = [pose.distance_to(other.poses[n]) for n, pose in optimum.variables.poses.items()]
    gaps += [math.dist(p, other.anchors[n]) for n, p in optimum.variables.anchors.items()]
    return max(gaps, default=0.0)


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
    table: RangeTable,
    variables: Variables,
    values: gtsam.Values,
    settings: GraphSettings,
) -> float:
    """Negative log likelihood of the fixed factors and the ranges."""
    residuals = table.residuals(variables)
    ranges = one_sided_cost(residuals, table.sigmas, settings.nlos_scale).sum()
    cost = float(fixed.error(values) + ranges)
    # GTSAM returns its start without complaint where a measurement is not a number.
    if not math.isfinite(cost):
        raise SolverError("the cost is not finite: a match, range or prior is not a number")
    return cost
