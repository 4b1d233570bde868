"""One point by least squares on its ranges (paper, eq. 10): started linearly and mirrored."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Points, Vector2
from ..model.settings import GraphSettings
from ..model.solution import Status
from .sightings import (
    Finding,
    Sightings,
    equal_places,
    height_candidates,
    height_covariance,
    mirror_image,
    spread_ratio,
)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A local minimum of eq. 10."""

    place: Vector2
    """(2,) m."""
    squares: float
    """m^2, sum of squared residuals."""
    covariance: Matrix2
    """(2, 2) m^2, inverse Hessian with the variance of the residuals."""


def fit_point(
    sightings: Sightings, height: float | None, offset: float, settings: GraphSettings
) -> tuple[Finding, Matrix2 | None]:
    """Place one point by least squares, or say why not.

    Args:
        sightings: from where it is seen.
        height: its height, m; None where nobody measured it: then it is sought too.
        offset: m, subtracted from every range.
        settings: limits.

    Returns:
        The finding, and the (2, 2) covariance of the place where there is one.
    """
    count = len(sightings.points)
    if count < settings.min_stations:
        return Finding(Status.UNREACHABLE, height=height, sightings=count), None
    heights = height_candidates(sightings) if height is None else np.array([height])
    fits, sought = min(
        ((_fits(sightings, h, offset, settings), float(h)) for h in heights),
        key=lambda found: found[0][0].squares,
    )
    best = fits[0]
    finding = Finding(Status.OK, best.place, sought, count)
    variance = _variance(best.squares, sightings)
    costs = np.array([(fit.squares - best.squares) / (2.0 * variance) for fit in fits])
    places = np.array([fit.place for fit in fits])
    if others := equal_places(places, costs, settings.mirror_cost_gap):
        finding = replace(finding, status=Status.MIRROR_AMBIGUOUS, place=None, alternatives=others)
        return finding, None
    if height is None:
        extra = height_covariance(best.place, sought, sightings)
        finding = replace(finding, status=Status.WEAK_GEOMETRY, extra=extra)
    elif spread_ratio(sightings.points) < settings.min_singular_ratio:
        finding = replace(finding, status=Status.WEAK_GEOMETRY)
    return finding, best.covariance


def linear_multilateration(sightings: Sightings, height: float, offset: float) -> Points:
    """(3, 2) starts: the linear solution, and the two places where points in line see it.

    The difference of two squared ranges is linear in the place; the mean equation is subtracted from
    all. Along the points' principal line that is always determined; across it, the mean square of
    what remains gives a distance but not a side.
    """
    centre = sightings.points.mean(axis=0)
    points = sightings.points - centre
    squares = (sightings.distances - offset) ** 2 - (height - sightings.heights) ** 2
    right = 0.5 * ((points**2).sum(axis=1) - squares)
    linear = np.linalg.lstsq(points, right - right.mean(), rcond=1e-6)[0]
    _, _, (along, across) = np.linalg.svd(points)
    position = float(linear @ along)
    rest = float(np.mean(squares - (points @ along - position) ** 2))
    aside = np.sqrt(max(rest, 0.0)) * across
    starts = np.array([linear, position * along + aside, position * along - aside])
    return np.asarray(starts + centre)


def _fits(sightings: Sightings, height: float, offset: float, settings: GraphSettings) -> list[Fit]:
    """Separate local minima, the best first."""
    fits = [
        _levenberg_marquardt(start, sightings, height, offset)
        for start in linear_multilateration(sightings, height, offset)
    ]
    best = min(fits, key=lambda fit: fit.squares)
    mirrored = mirror_image(best.place[None, :], sightings.points)[0]
    fits.append(_levenberg_marquardt(mirrored, sightings, height, offset))
    separate: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.squares):
        if all(np.hypot(*(fit.place - k.place)) > settings.twin_distance_m for k in separate):
            separate.append(fit)
    return separate


def _levenberg_marquardt(start: Vector2, sightings: Sightings, height: float, offset: float) -> Fit:
    from scipy.optimize import least_squares

    def residuals(place: FloatArray) -> FloatArray:
        return np.asarray(-sightings.residuals(place[None, :], height, offset)[0])

    def jacobian(place: FloatArray) -> FloatArray:
        delta = place - sightings.points
        slant = np.sqrt((delta**2).sum(axis=1) + (height - sightings.heights) ** 2)
        return np.asarray(delta / np.maximum(slant, 1e-9)[:, None])

    result = least_squares(residuals, start, jacobian, method="lm", xtol=1e-12, ftol=1e-12)
    squares = float(2.0 * result.cost)
    # Seen from straight below nothing is known sideways: 10 m instead of infinity.
    slopes, variance = jacobian(result.x), _variance(squares, sightings)
    hessian = slopes.T @ slopes / variance + 1e-2 * np.eye(2)
    return Fit(result.x, squares, np.asarray(np.linalg.inv(hessian), dtype=np.float64))


def _variance(squares: float, sightings: Sightings) -> float:
    """Variance of a range, m^2: that of the residuals, at least what links deserve."""
    # With three ranges and two unknowns the residuals are small by luck.
    freedom = max(1, len(sightings.points) - 2)
    return max(squares / freedom, float(np.mean(sightings.sigmas**2)))
