"""Robust point-to-line ICP, both ways, coarse to fine, for a batch of initial matches at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray
from ...model.settings import MatchingSettings
from ..batch import adjoints, compose, distinct, invert, transform
from ..index import ScanIndex
from ..score import score_matches

_SAME_FACE = 0.5  # least cosine between the normals of partners
_DAMPING = 0.005  # end walls bring 0.07 of a room's information, noise alone less than 0.007
_CAUCHY_M = 0.05  # loss scale while the match may still be off; registration study, 5
_COARSE = 3  # every third point is enough to find the basin
_SETTLED = 2e-2  # m and rad; partners swap at every step, so the last steps of a right match are millimetres
_SHRINK = 0.6
_STEPS, _STEPS_UNTIL_STILL = 6, 40
_STILL = 1e-8  # m and rad; nothing moves any more
_SCALE_FLOOR_M = 1e-9  # noise-free walls fit exactly


def refine_point_to_line(
    target: ScanIndex, source: ScanIndex, initial: FloatArray, settings: MatchingSettings
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Move poses target_T_source (K, 3) until the points of each scan lie on the walls of the other.

    Stages: every third point within 0.6 and 0.3 m, one way, to reach the basin; then all points
    within `fine_gate_m`, both ways, with a Cauchy loss; at last the loss takes the scale of the
    residuals themselves, so that points without a partner (clutter, doors) lose their pull as the
    walls come together.

    Between the stages, candidates that have become one and those with the least evidence are
    dropped.

    Returns:
        (J, 3) refined poses, J <= K, and (J,) whether the last step was shorter than 2 cm and 1
        degree.
    """
    poses = np.array(initial, dtype=np.float64).reshape(-1, 3)
    for gate in (0.6, 0.45, 0.3, 0.3):
        poses, _ = _step(
            target, source, poses, gate=gate, scale=0.5 * gate, stride=_COARSE, both_ways=False
        )
    evidence = score_matches(target, source, poses, settings, _COARSE).evidence
    best = distinct(poses, evidence, settings.hypotheses + settings.hypotheses // 2)
    return polish(target, source, poses[best], settings)


def polish(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    settings: MatchingSettings,
    *,
    until_still: bool = False,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The fine stage alone, for poses already within about 0.2 m and 5 degrees.

    `until_still` goes on, with partners found exactly, until nothing moves: the result then does
    not depend on where in the basin it started.
    """
    step = np.full((len(poses), 3), np.inf)
    for iteration in range(_STEPS_UNTIL_STILL if until_still else _STEPS):
        # The scale shrinks step by step: at once, the many points of one wall would set it, and the
        # few that hold the other direction would be outliers before they have settled.
        poses, step = _step(
            target,
            source,
            poses,
            gate=settings.fine_gate_m,
            scale=_CAUCHY_M * _SHRINK**iteration,
            stride=1,
            both_ways=True,
            exact=until_still,
        )
        if np.abs(step).max(initial=0.0) < _STILL:
            break
    # Where nothing pairs, nothing moves: that is no match.
    paired = correspondences(target, source, poses, gate=settings.fine_gate_m)[2].any(axis=1)
    return poses, paired & (np.abs(step) < _SETTLED).all(axis=1)


def _step(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    *,
    gate: float,
    scale: float,
    stride: int,
    both_ways: bool,
    exact: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """One Gauss-Newton step of every pose; returns poses (K, 3) and the steps in the source's axes (K, 3)."""
    residual, jacobian, weight = correspondences(
        target, source, poses, gate=gate, stride=stride, exact=exact
    )
    if both_ways:
        # Seen from the target: residual of inverse(T); d inverse = -Ad(T) d in its axes, undone in
        # the Jacobian.
        inverse = invert(poses)
        back_residual, back_jacobian, back_weight = correspondences(
            source, target, inverse, gate=gate, stride=stride, exact=exact
        )
        residual = np.concatenate([residual, back_residual], axis=1)
        jacobian = np.concatenate([jacobian, -back_jacobian @ adjoints(poses)], axis=1)
        weight = np.concatenate([weight, back_weight], axis=1)
    loss_scale = np.maximum(scale, _own_scale(residual, weight) if both_ways else 0.0)
    weight = weight / (1.0 + (residual / loss_scale) ** 2)
    weighted = jacobian * weight[:, :, None]
    hessian = np.swapaxes(jacobian, 1, 2) @ weighted
    gradient = (np.swapaxes(weighted, 1, 2) @ residual[:, :, None])[:, :, 0]
    step = damped_step(hessian, gradient)
    step = np.clip(step, -0.5, 0.5)
    return compose(poses, step), step


def damped_step(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(K, 3) Gauss-Newton steps of normal equations (K, 3, 3), (K, 3), in (x, y, theta).

    Damping keeps a direction that only the noise of normals holds (a corridor's axis) where it is.
    """
    translation = hessian[:, 0, 0] + hessian[:, 1, 1]
    damping = _DAMPING * np.stack([translation, translation, hessian[:, 2, 2]], axis=1) + 1e-12
    damped = hessian + damping[:, :, None] * np.eye(3)
    return np.asarray(-np.linalg.solve(damped, gradient[:, :, None])[:, :, 0])


def correspondences(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    *,
    gate: float,
    stride: int = 1,
    exact: bool = False,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Source points against the target's walls for poses target_T_source (K, 3).

    Returns:
        Residuals (K, N) m along the target's normals, their derivatives (K, N, 3) by a motion (x,
        y, theta) in the source's axes, and weights (K, N) in metres of wall, zero where no reliable
        wall lies within `gate` metres.
    """
    points = source.scan.points[::stride]
    moved = transform(poses, points)
    partner = target.nearest_exactly(moved) if exact else target.nearest(moved)
    dx = moved[..., 0] - target.scan.points[:, 0].take(partner)
    dy = moved[..., 1] - target.scan.points[:, 1].take(partner)
    nx, ny = target.scan.normals[:, 0].take(partner), target.scan.normals[:, 1].take(partner)
    residual = nx * dx + ny * dy
    close = (dx * dx + dy * dy < gate * gate) & target.reliable.take(partner)
    c, s = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
    # Normals in the source's axes, and the lever of a turn about the source's origin.
    jx, jy = c * nx + s * ny, c * ny - s * nx
    # The two faces of a wall lie within the gate; normals that face apart tell them from each other.
    normals = source.scan.normals[::stride]
    close &= jx * normals[:, 0] + jy * normals[:, 1] > _SAME_FACE
    jacobian = np.stack([jx, jy, jy * points[:, 0] - jx * points[:, 1]], axis=-1)
    return residual, jacobian, np.where(close, source.scan.lengths[::stride], 0.0)


def _own_scale(residual: FloatArray, weight: FloatArray) -> FloatArray:
    """(K, 1) Cauchy scale from the median absolute residual within the gate, at most the coarse one."""
    masked = np.where(weight > 0.0, np.abs(residual), np.nan)
    masked[np.isnan(masked).all(axis=1)] = _CAUCHY_M
    return np.clip(
        2.0 * 1.4826 * np.nanmedian(masked, axis=1, keepdims=True), _SCALE_FLOOR_M, _CAUCHY_M
    )
