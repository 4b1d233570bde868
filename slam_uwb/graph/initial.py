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
from .range_fit import LEAST_CURVATURE, OffsetPrior, fit_ranges
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
FAULTY = 0.5
"""A range is taken for a fault where that is likelier than not."""


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
    places, offsets, costs = _separate_minima(starts, sightings, sought, search)
    found = Finding(Status.OK, places[0], sought, count, candidates=places)
    if turn and (others := _moved(turn, float(costs[0]), sightings, sought, search)):
        note = "its ranges fit two places in turn: moved between stations?"
        return replace(found, status=Status.AMBIGUOUS, place=None, alternatives=others, note=note)
    if others := equal_places(places, costs, settings.mirror_cost_gap):
        return replace(found, status=Status.MIRROR_AMBIGUOUS, place=None, alternatives=others)
    if height is None:
        extra = height_covariance(places[0], sought, sightings)
        return replace(found, status=Status.WEAK_GEOMETRY, extra=extra)
    in_line = spread_ratio(sightings.points) < settings.min_singular_ratio
    if in_line or not _is_supported(places[0], offsets[0], sightings, sought, search):
        return replace(found, status=Status.WEAK_GEOMETRY)
    return found


def _is_supported(
    place: Vector2, offset: float, sightings: Sightings, height: float, search: Search
) -> bool:
    """Whether enough ranges, and most of them, agree with a place."""
    view = sightings.times(1, height)
    residuals, _ = view.residuals(place[None, :], np.array([offset]))
    labels = search.model.labels(view.points, place)
    _, faults = search.model.density(labels, view.sigmas).posterior(residuals)
    sound = int((faults < FAULTY).sum())
    # Two ranges meet somewhere whatever they are.
    return sound >= search.settings.min_stations and 2 * sound > len(sightings.points)


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
        rough, _, _ = refine_places(turn.places[k : k + 1], half, height, search, labelled=False)
        fine, _, costs = refine_places(rough, half, height, search)
        places[k], cost = fine[0], cost + float(costs[0])
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
) -> tuple[Points, FloatArray, FloatArray]:
    """Nearest minimum of the cost to each start, with the offset as nuisance.

    Args:
        starts: (K, 2) m.
        sightings: N distances.
        height: of the sought point, m.
        search: what the ranges are judged by.
        labelled: whether the map is asked for the walls on the paths to each start.

    Returns:
        (K, 2) places, (K,) offsets and (K,) costs (negative log posterior).
    """
    model, view = search.model, sightings.times(len(starts), height)
    labels = (
        model.labels(sightings.points, starts[:, None, :])
        if labelled
        else model.unlabelled(*view.distances.shape)
    )
    density = model.density(labels, view.sigmas)
    floor = LEAST_CURVATURE / model.sight_sigma**2
    fit = fit_ranges(view, density, search.prior, starts, floor, coupled=False, still=1e-8)
    return fit.places, fit.offsets, fit.costs


def _search_grid(sightings: Sightings, height: float, search: Search) -> Grid:
    """Costs of all ranges, without the map, wherever the point may be."""
    # Further out than the second smallest range, two ranges at least would be too short, which
    # walls cannot do. (The smallest alone may be a fault of the device.)
    margin = max(MARGIN, float(np.partition(sightings.distances, 1)[1]))
    axes, centre = _own_axes(sightings.points)
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


def _own_axes(points: Points) -> tuple[FloatArray, Vector2]:
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
) -> tuple[Points, FloatArray, FloatArray]:
    """Refined minima further than `twin_distance_m` apart, the best first: places, offsets, costs."""
    rough, _, rough_costs = refine_places(starts, sightings, height, search, labelled=False)
    twin = mirror_image(rough[[np.argmin(rough_costs)]], sightings.points)
    places = np.vstack([rough, twin])
    # Labels are those of where a place was: once more with those of where it went.
    places, _, costs = refine_places(places, sightings, height, search)
    # An anchor hangs on a wall; on its other side the labels are others, and so is the minimum.
    near = places[costs < costs.min() + HOPELESS]
    axes, _ = _own_axes(sightings.points)
    places = np.vstack([near, places[np.argmin(costs)] + RING @ axes.T])
    for _ in range(2):
        places, offsets, costs = refine_places(places, sightings, height, search)
    kept: list[int] = []
    for index in np.argsort(costs, kind="stable"):
        gaps = np.linalg.norm(places[kept] - places[index], axis=1)
        if not (gaps <= search.settings.twin_distance_m).any():
            kept.append(int(index))
    return places[kept], offsets[kept], costs[kept]


def find_height(sightings: Sightings, search: Search) -> float:
    """Height that explains the ranges best, m."""

    def cost(height: float) -> float:
        starts = _grid_minima(_search_grid(sightings, height, search))
        return float(refine_places(starts, sightings, height, search, labelled=False)[2].min())

    return float(min(height_candidates(sightings), key=cost))
