"""Where a point that only ranges see can be: global search, several minima, mirror images.

Least squares is no start at 60 % long ranges, and an anchor seen from stations in line has a twin.
So the cost is searched on a grid, without the map; every minimum is refined with the walls that the map
shows on its own paths; and a point is placed only where no other minimum explains its ranges nearly as
well. Tags are found from anchors by the same code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2, rotation_matrix
from ..model.link_law import LinkModel
from ..model.settings import GraphSettings
from ..model.solution import Alternative, Status
from .range_fit import LEAST_CURVATURE, OffsetPrior, RangeFit, fit_ranges
from .rivals import FAULTY, excluding_gaps
from .sightings import (
    Finding,
    Sightings,
    equal_places,
    height_candidates,
    height_covariance,
    mirror_image,
    spread_ratio,
)

MAX_CELLS = 20_000
"""The grid becomes coarser on larger sites; minima are wider than its step by far."""
MAX_STARTS = 6
"""Minima of the grid that are refined; more than four never mattered."""
MARGIN = 3.0
"""m searched beyond the outermost stations at least."""
RING = 0.5 * np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]])
"""m, about the best place in the axes of those that see it, from where other sides of walls are tried."""
HOPELESS = 20.0
"""nats above the best: no label brings such a place back."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """What the ranges are judged by while points are sought."""

    model: LinkModel
    prior: OffsetPrior
    settings: GraphSettings


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Where a point is sought."""

    cells: FloatArray
    """(H, W, 2) m."""
    costs: FloatArray
    """(H, W, N) of each range."""


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """A point that was moved between two sightings."""

    split: int
    """So many ranges were taken before."""
    places: Points
    """(2, 2) m, before and after."""


def find_point(
    sightings: Sightings, height: float | None, search: Search, before: Finding | None = None
) -> Finding:
    """Place one point by its ranges alone, or say why not.

    Args:
        sightings: from where it is seen.
        height: its height, m; None where nobody measured it: then it is sought too.
        search: what the ranges are judged by.
        before: what was found from about here; only its minima are looked at again.
    """
    count, settings = len(sightings.points), search.settings
    if count < settings.min_stations:
        return Finding(Status.UNREACHABLE, height=height, sightings=count)
    sought = height if before is None or height is not None else before.height
    if sought is None:
        sought = find_height(sightings, search)
    if before is not None and before.note is not None:
        return before
    turn: Turn | None = None
    starts = None if before is None else before.candidates
    if starts is None:
        grid = _search_grid(sightings, sought, search)
        starts, turn = _grid_minima(grid), _grid_turn(grid, settings)
    minima = _separate_minima(starts, sightings, sought, search)
    places, costs = minima.places, minima.costs
    found = Finding(Status.OK, places[0], sought, count, candidates=places)
    if turn and (others := _moved(turn, float(costs[0]), sightings, sought, search)):
        note = "its ranges fit two places in turn: moved between stations?"
        return replace(found, status=Status.AMBIGUOUS, place=None, alternatives=others, note=note)
    faults = _fault_probabilities(minima, sightings, sought, search)
    gaps = excluding_gaps(minima, faults, settings)
    if others := equal_places(places, costs, gaps):
        return replace(found, status=Status.MIRROR_AMBIGUOUS, place=None, alternatives=others)
    if height is None:
        extra = height_covariance(places[0], sought, sightings)
        return replace(found, status=Status.WEAK_GEOMETRY, extra=extra)
    in_line = spread_ratio(sightings.points) < settings.min_singular_ratio
    if in_line or not _is_supported(faults[0], settings):
        return replace(found, status=Status.WEAK_GEOMETRY)
    return found


def _is_supported(faults: FloatArray, settings: GraphSettings) -> bool:
    """Whether enough ranges, and most of them, agree with a place; (N,) probabilities of a fault there."""
    sound = int((faults < FAULTY).sum())
    # Two ranges meet somewhere whatever they are.
    return sound >= settings.min_stations and 2 * sound > len(faults)


def _fault_probabilities(
    minima: RangeFit, sightings: Sightings, height: float, search: Search
) -> FloatArray:
    """(K, N) how likely each range is a fault were each place right."""
    view = sightings.times(len(minima.places), height)
    residuals, _ = view.residuals(minima.places, minima.offsets)
    labels = search.model.labels(sightings.points, minima.places[:, None, :])
    return search.model.density(labels, view.sigmas).posterior(residuals)[1]


def _moved(
    turn: Turn, single: float, sightings: Sightings, height: float, search: Search
) -> tuple[Alternative, ...]:
    """The two places of a point that was moved between sightings; nothing where one place will do.

    Args:
        turn: where and when, by the grid.
        single: cost of the best single place.
        sightings: in the order in which they were made.
        height: of the point, m.
        search: what the ranges are judged by.
    """
    halves = sightings.part(slice(None, turn.split)), sightings.part(slice(turn.split, None))
    places, cost = np.zeros((2, 2)), 0.0
    for k, half in enumerate(halves):
        rough = refine_places(turn.places[k : k + 1], half, height, search, labelled=False)
        fine = refine_places(rough.places, half, height, search)
        places[k], cost = fine.places[0], cost + float(fine.costs[0])
    apart = float(np.hypot(*(places[1] - places[0])))
    if apart < search.settings.twin_distance_m or single - cost < search.settings.moved_cost_gap:
        return ()
    share = turn.split / len(sightings.points)
    return tuple(
        Alternative(float(x), float(y), None, weight)
        for (x, y), weight in zip(places, (share, 1.0 - share), strict=True)
    )


def refine_places(
    starts: Points, sightings: Sightings, height: float, search: Search, labelled: bool = True
) -> RangeFit:
    """Nearest minimum of the cost to each start (K, 2), m, with the offset as nuisance.

    Args:
        starts: (K, 2) m.
        sightings: N distances.
        height: of the sought point, m.
        search: what the ranges are judged by.
        labelled: whether the map is asked for the walls on the paths to each start.
    """
    model, view = search.model, sightings.times(len(starts), height)
    labels = (
        model.labels(sightings.points, starts[:, None, :])
        if labelled
        else model.unlabelled(*view.distances.shape)
    )
    density = model.density(labels, view.sigmas)
    floor = LEAST_CURVATURE / model.sight_sigma**2
    return fit_ranges(view, density, search.prior, starts, floor, coupled=False, still=1e-8)


def _search_grid(sightings: Sightings, height: float, search: Search) -> Grid:
    """Costs of all ranges, without the map, wherever the point may be."""
    # Further out than the second smallest range, two ranges at least would be too short, which
    # walls cannot do. (The smallest alone may be a fault of the device.)
    margin = max(MARGIN, float(np.partition(sightings.distances, 1)[1]))
    axes, centre = own_axes(sightings.points)
    points = (sightings.points - centre) @ axes
    low = points.min(axis=0) - margin
    size = np.ptp(points, axis=0) + 2.0 * margin
    step = max(search.settings.search_step_m, float(np.sqrt(size.prod() / MAX_CELLS)))
    x, y = (low[axis] + step * np.arange(int(size[axis] / step) + 2) for axis in (0, 1))
    cells = np.stack(np.meshgrid(x, y), axis=-1) @ axes.T + centre
    offset = search.prior.common.mean
    residuals = sightings.residuals(cells.reshape(-1, 2), height, offset)
    unlabelled = search.model.unlabelled(len(sightings.points))
    costs = search.model.density(unlabelled, sightings.sigmas).costs(residuals)
    return Grid(cells, costs.reshape(*cells.shape[:2], -1))


def own_axes(points: Points) -> tuple[FloatArray, Vector2]:
    """Axes (2, 2), as columns, and origin that move with the points: the grid does not depend on the frame."""
    centre = points.mean(axis=0)
    offsets = points - centre
    x, y = offsets[np.argmax(np.hypot(*offsets.T).round(6))]
    return rotation_matrix(math.atan2(y, x)), centre


def _grid_minima(grid: Grid) -> Points:
    """(K, 2) cells that cost less than their eight neighbours, the cheapest first."""
    costs = grid.costs.sum(axis=2)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(costs, 1, constant_values=np.inf), (3, 3)
    )
    lowest = windows.min(axis=(2, 3)) == costs
    cheapest = np.argsort(costs[lowest], kind="stable")[:MAX_STARTS]
    return np.asarray(grid.cells[lowest][cheapest])


def _grid_turn(grid: Grid, settings: GraphSettings) -> Turn | None:
    """When a point was moved, and its cells before and after, if the grid speaks for it at all."""
    count, least = grid.costs.shape[2], settings.min_stations
    if count < 2 * least:
        return None
    before = np.cumsum(grid.costs.reshape(-1, count), axis=1)
    after = before[:, -1:] - before
    splits = np.arange(least, count - least + 1)
    parts = before[:, splits - 1].min(axis=0) + after[:, splits - 1].min(axis=0)
    split = int(splits[np.argmin(parts)])
    # Cells are coarse, which costs two places more than one: the last word is with refined places.
    if before[:, -1].min() - parts.min() < settings.moved_cost_gap / 3.0:
        return None
    cells = grid.cells.reshape(-1, 2)
    best = [cells[np.argmin(side[:, split - 1])] for side in (before, after)]
    return Turn(split, np.array(best))


def _separate_minima(
    starts: Points, sightings: Sightings, height: float, search: Search
) -> RangeFit:
    """Refined minima further than `twin_distance_m` apart, the best first."""
    rough = refine_places(starts, sightings, height, search, labelled=False)
    twin = mirror_image(rough.places[[np.argmin(rough.costs)]], sightings.points)
    # Labels are those of where a place was: once more with those of where it went.
    fit = refine_places(np.vstack([rough.places, twin]), sightings, height, search)
    # An anchor hangs on a wall; on its other side the labels are others, and so is the minimum.
    near = fit.places[fit.costs < fit.costs.min() + HOPELESS]
    axes, _ = own_axes(sightings.points)
    places = np.vstack([near, fit.places[np.argmin(fit.costs)] + RING @ axes.T])
    for _ in range(2):
        fit = refine_places(places, sightings, height, search)
        places = fit.places
    kept: list[int] = []
    for index in np.argsort(fit.costs, kind="stable"):
        gaps = np.linalg.norm(places[kept] - places[index], axis=1)
        if not (gaps <= search.settings.twin_distance_m).any():
            kept.append(int(index))
    return fit.some(kept)


def find_height(sightings: Sightings, search: Search) -> float:
    """Height that explains the ranges best, m."""

    def cost(height: float) -> float:
        starts = _grid_minima(_search_grid(sightings, height, search))
        return float(refine_places(starts, sightings, height, search, labelled=False).costs.min())

    return float(min(height_candidates(sightings), key=cost))
