"""Where a point that only ranges see can be: global search, several minima, mirror images.

Least squares is no start at 60 % long ranges, and an anchor seen from stations in line has a twin.
So the one-sided cost is searched on a grid, every minimum is refined, and a point is placed only where
no other minimum explains its ranges nearly as well. Tags are found from anchors by the same code.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Points, Vector2
from ..model.settings import GraphSettings
from ..model.solution import Alternative, Status
from ..model.survey import RangeOffset
from .losses import one_sided_cost, one_sided_weight

MAX_CELLS = 40_000
"""The grid becomes coarser on larger sites; minima are wider than its step by far."""
MAX_STARTS = 12
"""Minima of the grid that are refined; more than four never mattered."""
MARGIN = 3.0
"""m searched beyond the outermost stations at least."""
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


def find_point(
    sightings: Sightings,
    height: float | None,
    offset: RangeOffset,
    settings: GraphSettings,
    again: Points | None = None,
) -> Finding:
    """Place one point by its ranges alone, or say why not.

    Args:
        sightings: from where it is seen.
        height: its height, m; None where nobody measured it: then it is sought too.
        offset: what is known of the offset common to all ranges.
        settings: limits.
        again: (K, 2) minima of an earlier search; only these are looked at again.
    """
    count = len(sightings.points)
    if count < settings.min_stations:
        return Finding(Status.UNREACHABLE, height=height, sightings=count)
    sought = height
    if sought is None:
        sought = find_height(sightings, offset, settings)
    starts = _grid_minima(sightings, sought, offset.mean, settings) if again is None else again
    places, costs = _separate_minima(starts, sightings, sought, offset, settings)
    found = Finding(Status.OK, places[0], sought, count, candidates=places)
    near = costs <= costs[0] + settings.mirror_cost_gap
    if near.sum() > 1:
        weights = np.exp(costs[0] - costs[near])
        others = tuple(
            Alternative(float(x), float(y), None, float(weight))
            for (x, y), weight in zip(places[near], weights / weights.sum(), strict=True)
        )
        return replace(found, status=Status.MIRROR_AMBIGUOUS, place=None, alternatives=others)
    if height is None:
        extra = height_covariance(places[0], sought, sightings, settings)
        return replace(found, status=Status.WEAK_GEOMETRY, extra=extra)
    if spread_ratio(sightings.points) < settings.min_singular_ratio:
        return replace(found, status=Status.WEAK_GEOMETRY)
    return found


def spread_ratio(points: Points) -> float:
    """How far (N, 2) points are from lying in line, 0 to 1: spread across it by spread along it."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(spread[1] / spread[0]) if len(spread) > 1 and spread[0] > 0.0 else 0.0


def mirror_image(places: Points, points: Points) -> Points:
    """(K, 2) places mirrored across the principal line of (N, 2) points."""
    centre = points.mean(axis=0)
    across = np.linalg.svd(points - centre)[2][1]
    return np.asarray(places - 2.0 * ((places - centre) @ across)[:, None] * across)


def refine_places(
    starts: Points,
    sightings: Sightings,
    height: float,
    offset: RangeOffset,
    scale: float,
    iterations: int = 60,
) -> tuple[Points, FloatArray]:
    """Nearest minimum of the one-sided cost to each start, with the offset as nuisance.

    Levenberg-Marquardt on iteratively re-weighted least squares, all starts at once.

    Args:
        starts: (K, 2) m.
        sightings: N distances.
        height: of the sought point, m.
        offset: prior of the offset.
        scale: of the loss, sigmas.
        iterations: at most.

    Returns:
        (K, 2) places and (K,) costs (negative log likelihood, the offset's prior included).
    """
    unknowns = np.column_stack([starts, np.full(len(starts), offset.mean)])
    damping = np.full(len(starts), 1e-3)
    costs = _cost(unknowns, sightings, height, offset, scale)
    for _ in range(iterations):
        steps = _steps(unknowns, damping, sightings, height, offset, scale)
        trial_costs = _cost(unknowns + steps, sightings, height, offset, scale)
        better = trial_costs <= costs
        unknowns = np.where(better[:, None], unknowns + steps, unknowns)
        costs = np.where(better, trial_costs, costs)
        damping = np.clip(np.where(better, damping * 0.2, damping * 10.0), 1e-9, 1e9)
        if np.abs(steps).max() < 1e-7:
            break
    return unknowns[:, :2], costs


def _steps(
    unknowns: FloatArray,
    damping: FloatArray,
    sightings: Sightings,
    height: float,
    offset: RangeOffset,
    scale: float,
) -> FloatArray:
    """(K, 3) damped Gauss-Newton steps of x, y and offset."""
    residuals, directions = _linearise(unknowns, sightings, height)
    weights = one_sided_weight(residuals, sightings.sigmas, scale) / sightings.sigmas**2
    hessian = np.einsum("kn,kni,knj->kij", weights, directions, directions)
    gradient = np.einsum("kn,kni,kn->ki", weights, directions, residuals)
    hessian[:, 2, 2] += offset.sigma**-2
    gradient[:, 2] += (offset.mean - unknowns[:, 2]) / offset.sigma**2
    diagonal = np.einsum("kii->ki", hessian)
    # A floor (of one range of 10 m) keeps a place straight below every station from being singular.
    diagonal += damping[:, None] * diagonal + 1e-2
    return np.linalg.solve(hessian, gradient[..., None])[..., 0]


def _linearise(
    unknowns: FloatArray, sightings: Sightings, height: float
) -> tuple[FloatArray, FloatArray]:
    """(K, N) residuals and (K, N, 3) derivatives of the prediction by x, y and offset."""
    delta = unknowns[:, None, :2] - sightings.points
    rise = (height - sightings.heights)[None, :]
    slant = np.sqrt((delta**2).sum(axis=2) + rise**2)
    directions = np.ones((*slant.shape, 3))
    directions[..., :2] = delta / np.maximum(slant, 1e-9)[..., None]
    return sightings.distances - slant - unknowns[:, 2, None], directions


def _cost(
    unknowns: FloatArray,
    sightings: Sightings,
    height: float,
    offset: RangeOffset,
    scale: float,
) -> FloatArray:
    residuals = sightings.residuals(unknowns[:, :2], height, 0.0) - unknowns[:, 2, None]
    prior = 0.5 * ((unknowns[:, 2] - offset.mean) / offset.sigma) ** 2
    return np.asarray(one_sided_cost(residuals, sightings.sigmas, scale).sum(axis=1) + prior)


def _grid_minima(
    sightings: Sightings, height: float, offset: float, settings: GraphSettings
) -> Points:
    """(K, 2) cells that cost less than their eight neighbours, the cheapest first."""
    # Further out than the second smallest range, two ranges at least would be too short, which
    # walls cannot do. (The smallest alone may be a fault of the device.)
    margin = max(MARGIN, float(np.partition(sightings.distances, 1)[1]))
    low = sightings.points.min(axis=0) - margin
    size = np.ptp(sightings.points, axis=0) + 2.0 * margin
    step = max(settings.search_step_m, float(np.sqrt(size.prod() / MAX_CELLS)))
    x, y = (low[axis] + step * np.arange(int(size[axis] / step) + 2) for axis in (0, 1))
    cells = np.stack(np.meshgrid(x, y), axis=-1)
    residuals = sightings.residuals(cells.reshape(-1, 2), height, offset)
    costs = one_sided_cost(residuals, sightings.sigmas, settings.nlos_scale).sum(axis=1)
    padded = np.pad(costs.reshape(len(y), len(x)), 1, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    lowest = windows.min(axis=(2, 3)) == padded[1:-1, 1:-1]
    minima = cells[lowest]
    cheapest = np.argsort(costs.reshape(lowest.shape)[lowest], kind="stable")[:MAX_STARTS]
    return np.asarray(minima[cheapest])


def _separate_minima(
    starts: Points,
    sightings: Sightings,
    height: float,
    offset: RangeOffset,
    settings: GraphSettings,
) -> tuple[Points, FloatArray]:
    """Refined minima further than `twin_distance_m` apart, the best first, with their costs."""
    places, costs = refine_places(starts, sightings, height, offset, settings.nlos_scale)
    twin = mirror_image(places[[np.argmin(costs)]], sightings.points)
    twin, twin_cost = refine_places(twin, sightings, height, offset, settings.nlos_scale)
    places, costs = np.vstack([places, twin]), np.append(costs, twin_cost)
    kept: list[int] = []
    for index in np.argsort(costs, kind="stable"):
        gaps = np.linalg.norm(places[kept] - places[index], axis=1)
        if not (gaps <= settings.twin_distance_m).any():
            kept.append(int(index))
    return places[kept], costs[kept]


def height_candidates(sightings: Sightings) -> FloatArray:
    """(H,) m, where an unmeasured height is sought.

    Tags at one height cannot tell above from below: above is taken, anchors hang on walls.
    """
    lowest = max(0.0, float(sightings.heights.min()))
    return np.arange(lowest, max(MAX_HEIGHT, lowest) + 1e-9, HEIGHT_STEP)


def find_height(sightings: Sightings, offset: RangeOffset, settings: GraphSettings) -> float:
    """Height that explains the ranges best, m."""

    def cost(height: float) -> float:
        starts = _grid_minima(sightings, height, offset.mean, settings)
        scale = settings.nlos_scale
        return float(refine_places(starts, sightings, height, offset, scale, 20)[1].min())

    return float(min(height_candidates(sightings), key=cost))


def height_covariance(
    place: Vector2, height: float, sightings: Sightings, settings: GraphSettings
) -> Matrix2:
    """(2, 2) m^2 by which an estimated height moves the place, to first order."""
    delta = place - sightings.points
    rise = height - sightings.heights
    slant = np.maximum(np.sqrt((delta**2).sum(axis=1) + rise**2), 1e-9)
    directions = np.column_stack([delta, rise]) / slant[:, None]
    residuals = sightings.distances - slant
    residuals -= np.median(residuals)
    weights = one_sided_weight(residuals, sightings.sigmas, settings.nlos_scale)
    hessian = (directions * (weights / sightings.sigmas**2)[:, None]).T @ directions
    # Anywhere up to the ceiling before the ranges spoke: variance of a uniform distribution.
    hessian += np.diag([1e-4, 1e-4, 12.0 / MAX_HEIGHT**2])
    full, fixed = np.linalg.inv(hessian)[:2, :2], np.linalg.inv(hessian[:2, :2])
    return np.asarray(full - fixed)
