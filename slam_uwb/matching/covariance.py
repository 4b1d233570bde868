"""Covariance of a scan match from the Hessian of its point-to-line residuals, corridors included.

Noise in the normals leaks false information along a corridor: the plain Hessian claims millimetres
where nothing holds the scan. What that noise alone would give is therefore computed and subtracted,
direction by direction.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import FloatArray, Matrix3, Pose2
from ..model.settings import MatchingSettings
from .batch import invert
from .index import ScanIndex
from .refiners.point_to_line import correspondences

_INFLATION = 1.5  # shared neighbours correlate the normals; Monte-Carlo value of library facts, 7
_LEAST_VARIANCE = 1e-12  # m^2; exact scans have none
_FREE_SIGMA = np.array(
    [1.0, 1.0, math.radians(10.0)]
)  # of a direction that the walls leave free: m, m, rad


def match_covariance(
    target: ScanIndex, source: ScanIndex, target_T_source: Pose2, settings: MatchingSettings
) -> tuple[Matrix3, bool]:
    """Covariance (3, 3) in the source's axes, order (x, y, theta), and whether a direction is degenerate.

    Information of both directions of matching (target's points against the source's walls and the
    other way round) is averaged, not added: both use the same noise. A floor covers what the
    residuals do not show (tilt, people, glass).
    """
    pose = target_T_source.vector[None, :]
    forth = _information(target, source, pose, settings)
    back = _information(source, target, invert(pose), settings)
    adjoint = target_T_source.adjoint()
    hessian = 0.5 * (forth[0] + adjoint.T @ back[0] @ adjoint)
    leak = 0.5 * (forth[1] + adjoint.T @ back[1] @ adjoint)
    noise = source.scan.noise**2 + target.scan.noise**2
    variance = max(forth[2], back[2], noise, _LEAST_VARIANCE)
    information, degenerate = _without_leak(hessian, leak)
    covariance = np.linalg.inv(information / (_INFLATION * variance) + np.diag(_FREE_SIGMA**-2.0))
    floor = np.array(
        [settings.sigma_floor_m, settings.sigma_floor_m, math.radians(settings.sigma_floor_deg)]
    )
    covariance += np.diag(floor**2)
    return 0.5 * (covariance + covariance.T), degenerate


def _information(
    target: ScanIndex, source: ScanIndex, pose: FloatArray, settings: MatchingSettings
) -> tuple[Matrix3, Matrix3, float]:
    """Unit-variance Hessian, what normal noise alone would give of it, and the residuals' variance, m^2."""
    residual, jacobian, weight = (
        values[0] for values in correspondences(target, source, pose, gate=settings.fine_gate_m)
    )
    used = weight > 0.0
    if not used.any():
        return np.zeros((3, 3)), np.zeros((3, 3)), 0.0
    residual, jacobian = residual[used], jacobian[used]
    scale = max(2.0 * 1.4826 * float(np.median(np.abs(residual))), 1e-9)
    loss = 1.0 / (1.0 + (residual / scale) ** 2)
    hessian = (jacobian * loss[:, None]).T @ jacobian
    # The same residuals if every normal were turned by its own standard deviation: derivatives
    # along the wall.
    points = source.scan.points[used]
    tangent = np.column_stack([-jacobian[:, 1], jacobian[:, 0]])
    along = np.column_stack([tangent, tangent[:, 1] * points[:, 0] - tangent[:, 0] * points[:, 1]])
    partner = target.nearest(Pose2.from_vector(pose[0]).transform(points))
    slope = np.minimum(target.scan.normal_variance[partner], 1.0)
    leak = (along * (loss * slope)[:, None]).T @ along
    return hessian, leak, float(np.average(residual**2, weights=loss**2))


def _without_leak(hessian: Matrix3, leak: Matrix3) -> tuple[Matrix3, bool]:
    """Information that exceeds three times what normal noise gives, in directions scaled to comparable units."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-12))
    values, axes = np.linalg.eigh(hessian / np.outer(scale, scale))
    false = np.einsum("ji,jk,ki->i", axes, leak / np.outer(scale, scale), axes)
    true = np.where(values > 3.0 * false, values - false, 0.0)
    return (axes * true) @ axes.T * np.outer(scale, scale), bool((true <= 0.0).any())
