"""One sought point: what it is seen from, what was found of it, and the geometry of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Points, Vector2
from ..model.solution import Alternative, Status
from .range_fit import RangeView

MAX_HEIGHT = 4.0
"""m. An unmeasured height is sought up to here."""
HEIGHT_STEP = 0.25
"""m, coarser than any effect on the place in the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """Distances from N known points to one sought point."""

    points: Points
    """(N, 2) m."""
    heights: FloatArray
    """(N,) m."""
    distances: FloatArray
    """(N,) m, slant, offset included."""
    sigmas: FloatArray
    """(N,) m."""

    def residuals(self, places: Points, height: float, offset: float) -> FloatArray:
        """(K, N) measured minus predicted of K places (K, 2)."""
        dx = places[:, None, 0] - self.points[:, 0]
        dy = places[:, None, 1] - self.points[:, 1]
        return self.distances - offset - np.sqrt(dx * dx + dy * dy + (height - self.heights) ** 2)

    def part(self, rows: slice) -> Sightings:
        """Some of them."""
        return Sightings(
            self.points[rows], self.heights[rows], self.distances[rows], self.sigmas[rows]
        )

    def times(self, count: int, height: float) -> RangeView:
        """The same view of `count` points at that height."""
        size = (count, len(self.points))
        return RangeView(
            np.broadcast_to(self.points, (*size, 2)),
            np.broadcast_to(height - self.heights, size),
            np.broadcast_to(self.distances, size),
            np.broadcast_to(self.sigmas, size),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """What the ranges say of one sought point."""

    status: Status
    place: Vector2 | None = None
    """(2,) m; None where it cannot be told."""
    height: float | None = None
    sightings: int = 0
    extra: Matrix2 | None = None
    """(2, 2) m^2 to add to the covariance of the graph: for a height that nobody measured, for the
    tails of the ranges."""
    candidates: Points | None = None
    """(K, 2) m, all separate minima, the best first: where to look again."""
    alternatives: tuple[Alternative, ...] = ()
    note: str | None = None
    """Why it is not placed, where the status does not say it all."""


def spread_ratio(points: Points) -> float:
    """How far (N, 2) points are from lying in line, 0 to 1: spread across it by spread along it."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(spread[1] / spread[0]) if len(spread) > 1 and spread[0] > 0.0 else 0.0


def mirror_image(places: Points, points: Points) -> Points:
    """(K, 2) places mirrored across the principal line of (N, 2) points."""
    centre = points.mean(axis=0)
    across = np.linalg.svd(points - centre)[2][1]
    return np.asarray(places - 2.0 * ((places - centre) @ across)[:, None] * across)


def equal_places(
    places: Points, costs: FloatArray, gaps: FloatArray | float
) -> tuple[Alternative, ...]:
    """The places that explain the ranges nearly as well as the best, or nothing where it is alone.

    Args:
        places: (K, 2) m, the best first.
        costs: (K,) negative log likelihoods.
        gaps: (K,) or one for all, of the cost, within which a place is not excluded.
    """
    near = costs <= costs[0] + gaps
    if near.sum() < 2:
        return ()
    weights = np.exp(costs[0] - costs[near])
    return tuple(
        Alternative(float(x), float(y), None, float(weight))
        for (x, y), weight in zip(places[near], weights / weights.sum(), strict=True)
    )


def height_candidates(sightings: Sightings) -> FloatArray:
    """(H,) m, where an unmeasured height is sought.

    Tags at one height cannot tell above from below: above is taken, anchors hang on walls.
    """
    lowest = max(0.0, float(sightings.heights.min()))
    return np.arange(lowest, max(MAX_HEIGHT, lowest) + 1e-9, HEIGHT_STEP)


def height_covariance(place: Vector2, height: float, sightings: Sightings) -> Matrix2:
    """(2, 2) m^2 by which an estimated height moves the place, to first order."""
    delta = place - sightings.points
    rise = height - sightings.heights
    slant = np.maximum(np.sqrt((delta**2).sum(axis=1) + rise**2), 1e-9)
    directions = np.column_stack([delta, rise]) / slant[:, None]
    residuals = sightings.distances - slant
    residuals -= np.median(residuals)
    # Long ranges tell little of the height (weights of a Cauchy loss).
    variances = sightings.sigmas**2 + residuals**2
    hessian = (directions / variances[:, None]).T @ directions
    # Anywhere up to the ceiling before the ranges spoke: variance of a uniform distribution.
    hessian += np.diag([1e-4, 1e-4, 12.0 / MAX_HEIGHT**2])
    full, fixed = np.linalg.inv(hessian)[:2, :2], np.linalg.inv(hessian[:2, :2])
    return np.asarray(full - fixed)
