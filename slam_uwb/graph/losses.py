"""What a range residual costs: one-sided, since walls make ranges longer and nothing makes them shorter.

Residuals are measured minus predicted minus offset. Losses are evaluated outside of GTSAM, which is
fed Gaussian factors only: robust noise models inside iSAM2 go astray.
"""

from __future__ import annotations

import numpy as np

from ..model.geometry import FloatArray


def one_sided_cost(residuals: FloatArray, sigmas: FloatArray, scale: float) -> FloatArray:
    """Negative log likelihood: Cauchy's loss where the range is long, quadratic where it is short.

    Args:
        residuals: m, any shape.
        sigmas: m, broadcast against them.
        scale: sigmas beyond which a long range loses weight.
    """
    whitened = residuals / sigmas
    long = np.maximum(whitened, 0.0) / scale
    return np.where(
        whitened > 0.0, 0.5 * scale**2 * np.log1p(long * long), 0.5 * whitened * whitened
    )


def one_sided_weight(residuals: FloatArray, sigmas: FloatArray, scale: float) -> FloatArray:
    """Weight of iterative re-weighting, 0-1: the loss's slope as a share of the quadratic's."""
    long = np.maximum(residuals / sigmas, 0.0) / scale
    return np.asarray(1.0 / (1.0 + long * long))


def one_sided_curvature(residuals: FloatArray, sigmas: FloatArray, scale: float) -> FloatArray:
    """Second derivative of the cost as a share of the quadratic's; negative far out."""
    square = (np.maximum(residuals / sigmas, 0.0) / scale) ** 2
    return np.asarray((1.0 - square) / (1.0 + square) ** 2)
