"""Where a point that only ranges see can be: global search, several minima, mirror images.

Least squares is no start at 60 % long ranges, and an anchor seen from stations in line has a twin.
So the one-sided cost is searched on a grid, every minimum is refined, and a point is placed only where
no other minimum explains its ranges nearly as well. Tags are found from anchors by the same code.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2
from ..model.settings import GraphSettings
from ..model.solution import Status
from ..model.survey import RangeOffset
from .losses import one_sided_cost, one_sided_weight
from .sightings import (
    Finding,
    Sightings,
    equal_places,
    height_candidates,
    height_covariance,
    mirror_image,
    spread_ratio,
)

MAX_CELLS = 40_000
"""The grid becomes coarser on larger sites; minima are wider than its step by far."""
MAX_STARTS = 12
"""Minima of the grid that are refined; more than four never mattered."""
MARGIN = 3.0
"""m searched beyond the outermost stations at least."""
TOO_SHORT = 5.0
"""Sigmas. Walls make ranges longer; one that is shorter than this is a fault, or the place is."""


def find_point(
    sightings: Sightings,
    height: float | None,
    offset: RangeOffset,
    settings: GraphSettings,
    before: Finding | None = None,
) -> Finding:
    """Place one point by its ranges alone, or say why not.

    Args:
        sightings: from where it is seen.
        height: its height, m; None where nobody measured it: then it is sought too.
        offset: what is known of the offset common to all ranges.
        settings: limits.
        before: what was found from about here; only its minima are looked at again.
    """
    count = len(sightings.points)
    if count < settings.min_stations:
        return Finding(Status.UNREACHABLE, height=height, sightings=count)
    sought = height if before is None or height is not None else before.height
    if sought is None:
        sought = find_height(sightings, offset, settings)
    starts = None if before is None else before.candidates
    if starts is None:
        starts = _grid_minima(sightings, sought, offset.mean, settings)
    places, costs = _separate_minima(starts, sightings, sought, offset, settings)
    found = Finding(Status.OK, places[0], sought, count, candidates=places)
    if others := equal_places(places, costs, settings.mirror_cost_gap):
        return replace(found, status=Status.MIRROR_AMBIGUOUS, place=None, alternatives=others)
    if height is None:
        extra = height_covariance(places[0], sought, sightings, settings)
        return replace(found, status=Status.WEAK_GEOMETRY, extra=extra)
    in_line = spread_ratio(sightings.points) < settings.min_singular_ratio
    if in_line or not _is_supported(places[0], sightings, sought, offset, settings):
        return replace(found, status=Status.WEAK_GEOMETRY)
    return found


def _is_supported(
    place: Vector2,
    sightings: Sightings,
    height: float,
    offset: RangeOffset,
    settings: GraphSettings,
) -> bool:
    """Whether enough ranges agree with a place, and none is impossibly short for it."""
    residuals = sightings.residuals(place[None, :], height, offset.mean)[0]
    weights = one_sided_weight(residuals, sightings.sigmas, settings.nlos_scale)
    # Two ranges meet somewhere whatever they are: half of a third one at least has to agree.
    enough = float(weights.sum()) >= settings.min_stations - 0.5
    return enough and bool((residuals > -TOO_SHORT * sightings.sigmas).all())


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


def find_height(sightings: Sightings, offset: RangeOffset, settings: GraphSettings) -> float:
    """Height that explains the ranges best, m."""

    def cost(height: float) -> float:
        starts = _grid_minima(sightings, height, offset.mean, settings)
        scale = settings.nlos_scale
        return float(refine_places(starts, sightings, height, offset, scale, 20)[1].min())

    return float(min(height_candidates(sightings), key=cost))
