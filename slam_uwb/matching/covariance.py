"""Covariance of a scan match from the residuals it leaves: point by point, wall by wall, corridors included.

A sandwich estimate, ``H^-1 M H^-1``: H is the Hessian of the refiner's cost, M the covariance of its
gradient. M is not assumed but seen. Points scatter about their walls; and whole walls miss each
other (tilt, glass, ranges that depend on what they hit), where all points of a wall err together
and tell it only once.

Noise in the normals leaks false information along a corridor: the plain Hessian claims millimetres
where nothing holds the scan. What that noise alone would give is therefore computed, and directions
that have little more are free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Matrix3, Pose2
from ..model.settings import MatchingSettings
from .batch import adjoints, invert, transform
from .correspondences import correspondences
from .index import ScanIndex

_LEAST_VARIANCE = 1e-8  # m^2; exact scans have none, and what has none cannot be inverted
# Of a direction that the walls leave free: 1 m, 1 m, 10 degrees.
_FREE_SIGMAS = np.array([1.0, 1.0, math.radians(10.0)])
_LEAK = 3.0  # a direction needs so many times the information that noise of the normals gives
_CAUCHY_SIGMAS = 2.0  # the refiner's last loss: its scale by the residuals' standard deviation
_LEAST_SCALE_M, _MOST_SCALE_M = 1e-9, 0.05
# Of Gaussian residuals r under that loss, with weights k: E[k^2 r^2] / (E[k^2] E[r^2]).
_LOSS_SHARE = 0.58
_LEAST_SHARPNESS = 0.3  # curvature of that loss by its weights; 0.75 for Gaussian residuals
_MOST_LEVERAGE = 0.8  # what alone holds a direction has no residual to tell its error by
_SAME_WALL_COS, _SAME_WALL_M = 0.9, 0.1  # neighbouring points: between normals; step across


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Residuals of both ways in one table, one for each point: P points, the source's first.

    Arrays of vectors are kept component by component, (3, P): products then run along memory.
    """

    residual: FloatArray
    """(P,) m."""
    jacobian: FloatArray
    """(3, P) by a motion (x, y, theta) of the source in its own axes."""
    along: FloatArray
    """(3, P) the same, had the wall the direction of its normal."""
    metres: FloatArray
    """(P,) of wall that the point stands for; 0 = no partner."""
    slope_variance: FloatArray
    """(P,) of the partner's wall."""
    partner: NDArray[np.intp]
    """(P,) number of the point of the other scan."""
    wall: NDArray[np.intp]
    """(P,) number of the straight wall that the point is of."""


@dataclass(frozen=True, slots=True, eq=False)
class _Cost:
    """The refiner's cost about the match."""

    hessian: Matrix3
    """As iterated: with the weights of the loss."""
    sharpness: float
    """What the curvature is of it: far residuals pull less the further they are."""
    weight: FloatArray
    """(P,) m of wall, times the loss."""
    gradients: FloatArray
    """(3, P) derivative of each point's share in the gradient by its own residual."""
    deviation: float
    """m^2, variance of a residual under the loss."""


def match_covariance(
    target: ScanIndex, source: ScanIndex, target_T_source: Pose2, settings: MatchingSettings
) -> tuple[Matrix3, bool]:
    """Covariance (3, 3) in the source's axes, order (x, y, theta), and whether a direction is degenerate.

    A direction that the walls leave free has 1 m or 10 degrees. A floor stands for what no residual
    shows (`sigma_floor_m`, `sigma_floor_deg`).

    Source: Huber's sandwich with the jackknifed residuals HC3 of MacKinnon & White (1985) for
    points, a random effect a wall by the moments of DerSimonian & Laird (1986); degenerate
    directions by library facts, 7.
    """
    poses = target_T_source.vector[None, :]
    (found,) = match_covariances(target, source, poses, settings)
    return found


def match_covariances(
    target: ScanIndex, source: ScanIndex, poses: FloatArray, settings: MatchingSettings
) -> list[tuple[Matrix3, bool]]:
    """The same at each of the poses target_T_source (K, 3)."""
    noise = source.scan.noise**2 + target.scan.noise**2
    return [
        _covariance(*_information(rows, noise), settings)
        for rows in _both_ways(target, source, poses, settings.fine_gate_m)
    ]


def _covariance(
    information: Matrix3, degenerate: bool, settings: MatchingSettings
) -> tuple[Matrix3, bool]:
    """Covariance of the information (3, 3), its free directions bounded and with the floor."""
    # By eigenvalues: information that is all but infinite leaves none below zero.
    values, axes = np.linalg.eigh(information * _FREE_SIGMAS[:, None] * _FREE_SIGMAS)
    axes = axes * _FREE_SIGMAS[:, None]
    axes = axes / np.sqrt(1.0 + np.maximum(values, 0.0))
    covariance = axes @ axes.T
    floor = (settings.sigma_floor_m, settings.sigma_floor_m, math.radians(settings.sigma_floor_deg))
    covariance.ravel()[::4] += np.square(floor)
    return covariance, degenerate


def _both_ways(
    target: ScanIndex, source: ScanIndex, poses: FloatArray, gate: float
) -> Iterator[_Rows]:
    """The residuals that the refiner's fine stage sees at each of the poses target_T_source (K, 3)."""
    inverses = invert(poses)
    forth = correspondences(target, source, poses, gate=gate)
    back = correspondences(source, target, inverses, gate=gate)
    count = len(source.scan.points)
    residual, metres, partner, slopes = (
        np.concatenate(both, axis=1)
        for both in (
            (forth.residual, back.residual),
            (forth.weight, back.weight),
            (forth.partner + count, back.partner),
            (
                target.scan.normal_variance.take(forth.partner),
                source.scan.normal_variance.take(back.partner),
            ),
        )
    )
    wall = _walls(target.columns, source.columns)
    # d inverse(T) = -Ad(T) d in its axes.
    turned = np.swapaxes(-adjoints(poses), 1, 2) @ np.swapaxes(back.jacobian, 1, 2)
    jacobians = np.concatenate([np.swapaxes(forth.jacobian, 1, 2), turned], axis=2)
    target_here = transform(inverses, target.scan.points)
    for k, jacobian in enumerate(jacobians):
        x, y = np.concatenate([source.columns[:2], target_here[k].T], axis=1)
        along = np.empty_like(jacobian)
        along[0], along[1] = -jacobian[1], jacobian[0]
        along[2] = jacobian[0] * x + jacobian[1] * y
        yield _Rows(
            residual=residual[k],
            jacobian=jacobian,
            along=along,
            metres=metres[k],
            slope_variance=slopes[k],
            partner=partner[k],
            wall=wall,
        )


def _walls(target: FloatArray, source: FloatArray) -> NDArray[np.intp]:
    """(P,) number of the wall of each point, the source's first, from columns (4, N) ordered by bearing.

    A wall ends where the next point has another direction or lies off its line.
    """
    first = source.shape[1]
    here = np.concatenate([source, target], axis=1)
    after = np.concatenate([source[:, 1:], source[:, :1], target[:, 1:], target[:, :1]], axis=1)
    facing = here[2:] * after[2:]
    across = here[2:] * (after[:2] - here[:2])
    ends = facing[0] + facing[1] < _SAME_WALL_COS
    ends |= np.abs(across[0] + across[1]) > _SAME_WALL_M
    wall = np.cumsum(ends)
    wall -= ends
    wall[first:] += 1  # never one with the source's last
    for scan, last in ((wall[:first], ends[first - 1]), (wall[first:], ends[-1])):
        if not last:
            scan[scan == scan[-1]] = scan[0]  # one wall across the seam of the bearings
    return wall


def _information(rows: _Rows, noise: float) -> tuple[Matrix3, bool]:
    """Information (3, 3) of the directions that walls hold, and whether one is free.

    `noise` is the variance of a residual by the scans' own scatter, m^2.
    """
    if not rows.metres.any():
        return np.zeros((3, 3)), True
    cost = _cost(rows, noise)
    weight = cost.weight * np.minimum(rows.slope_variance, 1.0)
    leak = (rows.along * weight) @ rows.along.T
    units, axes, held = _held_axes(cost.hessian, leak)
    held *= cost.sharpness
    steps = axes / units[:, None] / held
    spread = steps.T @ _gradient_covariance(rows, cost) @ steps
    axes = axes * units[:, None]
    return axes @ np.linalg.inv(spread) @ axes.T, len(held) < 3


def _cost(rows: _Rows, noise: float) -> _Cost:
    """The cost under the loss with which the refiner ends."""
    sizes = np.abs(rows.residual[rows.metres > 0.0])
    middle = len(sizes) // 2
    deviation = 1.4826 * float(np.partition(sizes, middle)[middle])
    scale = min(max(_CAUCHY_SIGMAS * deviation, _LEAST_SCALE_M), _MOST_SCALE_M)
    squared = (rows.residual / scale) ** 2
    loss = 1.0 / (1.0 + squared)
    weight = rows.metres * loss
    gradients = rows.jacobian * weight
    twice = weight * loss
    sharpness = float(twice @ (1.0 - squared)) / float(weight.sum())
    seen = scale**2 * float(twice @ squared) / float(twice.sum())
    return _Cost(
        hessian=gradients @ rows.jacobian.T,
        sharpness=max(sharpness, _LEAST_SHARPNESS),
        weight=weight,
        gradients=gradients,
        deviation=max(seen, _LOSS_SHARE * noise, _LEAST_VARIANCE),
    )


def _held_axes(hessian: Matrix3, leak: Matrix3) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Units (3,), the axes (3, H) in them that hold more than noise of the normals gives, their information (H,).

    Both translations have one unit: turning the source turns the axes and nothing else.
    """
    translation = 0.5 * (hessian[0, 0] + hessian[1, 1])
    units = np.sqrt(np.maximum([translation, translation, hessian[2, 2]], 1e-12))
    both = units[:, None] * units
    values, axes = np.linalg.eigh(hessian / both)
    false = ((leak / both) @ axes * axes).sum(axis=0)
    held = values > _LEAK * false
    return units, axes[:, held], values[held]


def _gradient_covariance(rows: _Rows, cost: _Cost) -> Matrix3:
    """(3, 3) what errors of the points and of the walls do to the gradient of the cost."""
    # A point takes part in its own residual and, with the other sign, in those it is a partner of.
    influence = cost.gradients - _sums(rows.partner, cost.gradients, len(rows.residual))
    inverse = np.linalg.inv(cost.hessian + 1e-9 * np.trace(cost.hessian) * np.eye(3))
    # Half of a residual's variance is each scan's. A point that pulls the match towards itself has
    # a smaller residual than error: by its leverage, twice that of one way.
    leverage = 2.0 * (inverse @ cost.gradients * rows.jacobian).sum(axis=0)
    error = rows.residual / (1.0 - np.minimum(leverage, _MOST_LEVERAGE))
    variance = 0.5 * np.where(rows.metres > 0.0, error**2 + _LEAST_VARIANCE, cost.deviation)
    walls = _sums(rows.wall, influence, 0)
    scatter = (influence * variance) @ influence.T
    return np.asarray(scatter + _wall_variance(rows, cost, inverse) * (walls @ walls.T))


def _wall_variance(rows: _Rows, cost: _Cost, inverse: Matrix3) -> float:
    """Variance of the walls of one scan, m^2: what their mean residuals have beyond that of their points.

    By moments: of the weighted squares of the means, what the scatter of the points and the fit do
    not account for.
    """
    weight, wall = cost.weight, rows.wall
    metres = np.bincount(wall, weight)
    seen = metres > 0.0
    metres[~seen] = 1.0
    # Residuals with one partner share its error.
    shared = np.bincount(rows.partner, weight, len(weight)).take(rows.partner)
    scatter = 0.5 * cost.deviation * np.bincount(wall, weight * (weight + shared))
    gradients = _sums(wall, cost.gradients, 0)
    leverage = 2.0 * (inverse @ gradients * gradients).sum(axis=0) / metres
    kept = 1.0 - np.minimum(leverage, _MOST_LEVERAGE)
    squares = np.bincount(wall, weight * rows.residual) ** 2
    excess = float(((squares - scatter * kept) / metres).sum())
    # Residuals between walls of two scans have the variance of both.
    return max(0.0, 0.5 * excess / float((metres * kept)[seen].sum()))


def _sums(groups: NDArray[np.intp], vectors: FloatArray, count: int) -> FloatArray:
    """(3, G) sums of the vectors (3, P) of each group; at least `count` groups."""
    return np.array([np.bincount(groups, component, count) for component in vectors])
