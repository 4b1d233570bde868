"""Products -> GTSAM factors. The only place that makes keys and knows GTSAM's conventions.

- Pose2 tangent order (x, y, theta), in the pose's own axes; a between factor's residual lives in the
  source's axes, as the covariance of a `ScanMatch` does.
- Range residuals are predicted minus measured; a range made long by a wall is negative here.
- GTSAM takes a covariance that is not positive definite without complaint: it is checked first.
"""

from __future__ import annotations

import math

import gtsam
import numpy as np

from ..model.errors import SolverError
from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.survey import KnownPlace, RangeOffset

OFFSET_KEY: int = gtsam.symbol("b", 0)
"""The offset common to all ranges, a plain double."""

GAUGE_SIGMA = 1e-6
"""m and rad. The gauge fixes the frame; loose enough that the normal equations stay well scaled."""
WEAK_PLACE_SIGMA = 100.0
"""m. Keeps a place that the ranges leave a direction free from making the system singular."""
WEAK_HEADING_SIGMA = math.pi
"""rad. A heading that nothing measures."""


def X(index: int) -> int:
    """Key of station `index` of the problem, a Pose2."""
    return int(gtsam.symbol("x", index))


def L(index: int) -> int:
    """Key of anchor `index` of the problem, a Point2."""
    return int(gtsam.symbol("l", index))


def D(index: int) -> int:
    """Key of the offset of the links of anchor `index` of the problem, a plain double."""
    return int(gtsam.symbol("d", index))


def to_gtsam(pose: Pose2) -> gtsam.Pose2:
    """The same pose as GTSAM has it."""
    return gtsam.Pose2(pose.x, pose.y, pose.theta)


def from_gtsam(pose: gtsam.Pose2) -> Pose2:
    """The same pose as the model has it."""
    return Pose2(pose.x(), pose.y(), pose.theta())


def covariance_noise(covariance: FloatArray, what: str) -> gtsam.noiseModel.Gaussian:
    """Gaussian noise of a covariance that was checked.

    Raises:
        SolverError: it is not finite, not symmetric or not positive definite; `what` is named.
    """
    if not np.isfinite(covariance).all():
        raise SolverError(f"the covariance of {what} is not finite")
    # Scaled to a unit diagonal, so that metres and radians are judged alike.
    scale = np.sqrt(np.abs(np.diag(covariance)))
    scaled = covariance / np.outer(scale, scale) if (scale > 0.0).all() else covariance
    symmetric = np.allclose(scaled, scaled.T, atol=1e-9)
    if not symmetric or np.linalg.eigvalsh((scaled + scaled.T) / 2.0)[0] <= 1e-12:
        raise SolverError(f"the covariance of {what} is not symmetric and positive definite")
    return gtsam.noiseModel.Gaussian.Covariance((covariance + covariance.T) / 2.0)


def match_factor(match: ScanMatch, target: int, source: int) -> gtsam.BetweenFactorPose2:
    """A match between the stations with indices `target` and `source`."""
    noise = covariance_noise(match.covariance, f"match {match.target} - {match.source}")
    return gtsam.BetweenFactorPose2(X(target), X(source), to_gtsam(match.target_T_source), noise)


def gauge_factor(station: int, pose: Pose2) -> gtsam.PriorFactorPose2:
    """Fixes the frame by fixing one station."""
    noise = gtsam.noiseModel.Isotropic.Sigma(3, GAUGE_SIGMA)
    return gtsam.PriorFactorPose2(X(station), to_gtsam(pose), noise)


def known_station_factors(station: int, known: KnownPlace) -> list[gtsam.NonlinearFactor]:
    """Priors of a surveyed station: its place, and its heading where that was surveyed too."""
    place = gtsam.noiseModel.Isotropic.Sigma(2, known.sigma)
    centre = np.array([known.x, known.y])
    factors: list[gtsam.NonlinearFactor] = [gtsam.PoseTranslationPrior2D(X(station), centre, place)]
    if known.theta is not None:
        factors.append(heading_factor(station, known.theta, known.sigma_theta))
    return factors


def station_prior(station: int, place: FloatArray, sigma: float) -> gtsam.PoseTranslationPrior2D:
    """Prior of a station's place (2,), its heading left free."""
    noise = gtsam.noiseModel.Isotropic.Sigma(2, sigma)
    return gtsam.PoseTranslationPrior2D(X(station), np.asarray(place), noise)


def heading_factor(
    station: int, theta: float, sigma: float = WEAK_HEADING_SIGMA
) -> gtsam.PoseRotationPrior2D:
    """Prior of a heading; by default the weak one of a station that nothing turns."""
    noise = gtsam.noiseModel.Isotropic.Sigma(1, sigma)
    return gtsam.PoseRotationPrior2D(X(station), gtsam.Pose2(0.0, 0.0, theta), noise)


def anchor_prior(anchor: int, place: FloatArray, sigma: float) -> gtsam.PriorFactorPoint2:
    """Prior of an anchor's place (2,): tight where surveyed, weak where only to keep it in reach."""
    return gtsam.PriorFactorPoint2(L(anchor), place, gtsam.noiseModel.Isotropic.Sigma(2, sigma))


def offset_prior(offset: RangeOffset) -> gtsam.PriorFactorDouble:
    """Prior of the offset common to all ranges."""
    noise = gtsam.noiseModel.Isotropic.Sigma(1, offset.sigma)
    return gtsam.PriorFactorDouble(OFFSET_KEY, offset.mean, noise)


def delay_prior(anchor: int, sigma: float) -> gtsam.BetweenFactorDouble:
    """Ties the offset of an anchor's links to the common one."""
    noise = gtsam.noiseModel.Isotropic.Sigma(1, sigma)
    return gtsam.BetweenFactorDouble(OFFSET_KEY, D(anchor), 0.0, noise)


def curvature_factor(anchor: int, hessian: FloatArray) -> gtsam.HessianFactor:
    """``0.5 delta^T hessian delta``; delta is (x, y, offset) of an anchor."""
    place, offset = np.zeros(2), np.zeros(1)
    return gtsam.HessianFactor(
        L(anchor), D(anchor), hessian[:2, :2], hessian[:2, 2:], place, hessian[2:, 2:], offset, 0.0
    )


def slant_range_factor(
    station: int, anchor: int, measured: float, sigma: float, lever: FloatArray, rise: float
) -> gtsam.CustomFactor:
    """Slant range from a station's tag to an anchor, with the offset of the anchor's links.

    Predicted is ``|anchor - (station + R lever), rise| + offset``: exact also near and below the
    anchor, where a range projected to the floor is wrong or does not exist.

    Args:
        station: index of the station.
        anchor: index of the anchor.
        measured: slant distance as measured, offset included, m.
        sigma: its standard deviation, m.
        lever: (2,) the tag in the scanner's frame, m.
        rise: anchor's height minus the tag's, m.
    """
    pose_key, point_key, offset_key = X(station), L(anchor), D(anchor)
    lever_x, lever_y = float(lever[0]), float(lever[1])

    def error(
        _factor: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[FloatArray] | None
    ) -> FloatArray:
        pose, point = values.atPose2(pose_key), values.atPoint2(point_key)
        c, s = math.cos(pose.theta()), math.sin(pose.theta())
        dx = point[0] - pose.x() - c * lever_x + s * lever_y
        dy = point[1] - pose.y() - s * lever_x - c * lever_y
        slant = math.sqrt(dx * dx + dy * dy + rise * rise)
        if jacobians is not None:
            # Straight below the anchor the horizontal derivative does not exist; zero is its mean.
            u, v = (dx / slant, dy / slant) if slant > 1e-9 else (0.0, 0.0)
            along, across = u * c + v * s, v * c - u * s  # the direction in the scanner's axes
            turn = along * lever_y - across * lever_x
            jacobians[0] = np.array([[-along, -across, turn]])
            jacobians[1] = np.array([[u, v]])
            jacobians[2] = np.array([[1.0]])
        return np.array([slant + values.atDouble(offset_key) - measured])

    noise = gtsam.noiseModel.Isotropic.Sigma(1, sigma)
    return gtsam.CustomFactor(noise, [pose_key, point_key, offset_key], error)


def anchor_range_factor(
    anchor_a: int, anchor_b: int, measured: float, sigma: float, rise: float
) -> gtsam.CustomFactor:
    """Slant range between two anchors, with the common offset; arguments as `slant_range_factor`."""
    key_a, key_b = L(anchor_a), L(anchor_b)

    def error(
        _factor: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[FloatArray] | None
    ) -> FloatArray:
        dx, dy = values.atPoint2(key_b) - values.atPoint2(key_a)
        slant = math.sqrt(dx * dx + dy * dy + rise * rise)
        if jacobians is not None:
            u, v = (dx / slant, dy / slant) if slant > 1e-9 else (0.0, 0.0)
            jacobians[0] = np.array([[-u, -v]])
            jacobians[1] = np.array([[u, v]])
            jacobians[2] = np.array([[1.0]])
        return np.array([slant + values.atDouble(OFFSET_KEY) - measured])

    noise = gtsam.noiseModel.Isotropic.Sigma(1, sigma)
    return gtsam.CustomFactor(noise, [key_a, key_b, OFFSET_KEY], error)
