"""Pieces of wall -> rooms as closed polygons.

The lines of the walls cut the floor into cells (an arrangement, as in Oesau, Lafarge and Alliez 2014);
cells between which nothing stands are one room. A door closes a room as its wall does: it is a
gap between two pieces of one line no wider than a door.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely import LineString, Polygon, STRtree
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from ..model.floor import FloorMap, Room
from ..model.geometry import FloatArray, Points
from ..model.products import WallPieces
from ..model.settings import MappingSettings

_SEEN_SHARE = 0.3
"""Share of a room's area that was seen; less is a shaft, a wall's inside or somebody else's room."""
_SAMPLE_M = 0.05
_ON_WALL_M = 0.03
_CLOSED_SHARE = 0.5
"""Of the edge between two cells that wall or door must cover to part them."""
_SLIVER_M = 0.04
"""Narrower spikes and notches are two lines of one face, not walls."""


def find_rooms(
    pieces: WallPieces, floor_map: FloorMap, settings: MappingSettings
) -> tuple[Room, ...]:
    """Closed rooms that the scans saw, the largest first; what does not close is no room.

    Args:
        pieces: walls and furniture, world frame (`find_walls`).
        floor_map: what was looked through.
        settings: `room_...`, `wall_chain_gap_m` and `wall_fill_gap_m`.
    """
    chosen = pieces.probability >= settings.room_wall_probability
    line, ends = pieces.line[chosen], pieces.ends[chosen]
    if len(ends) < 3:
        return ()
    closed = closing_segments(line, ends, settings.wall_chain_gap_m)
    cells, edges = _arrangement(line, ends, settings.wall_fill_gap_m)
    if not len(cells):
        return ()
    groups = _merge_open(cells, edges, closed)
    rooms = []
    for group in np.unique(groups[groups >= 0]):
        polygon = _tidy(shapely.union_all(cells[groups == group]))
        if polygon is None or polygon.area < settings.room_min_area_m2:
            continue
        if _seen_share(polygon, floor_map) >= _SEEN_SHARE:
            rooms.append(Room(np.asarray(polygon.exterior.coords)[:-1], polygon.area))
    return tuple(sorted(rooms, key=lambda room: (-room.area, tuple(room.polygon[0]))))


def closing_segments(line: NDArray[np.int32], ends: FloatArray, door: float) -> FloatArray:
    """(C, 2, 2) m, the pieces of wall, and the gaps between two of one line no wider than a `door`, m."""
    gaps = door_gaps(line, ends, door)
    return np.concatenate([ends, gaps])


def door_gaps(line: NDArray[np.int32], ends: FloatArray, door: float) -> FloatArray:
    """(G, 2, 2) m, the gaps between pieces (P, 2, 2) that follow each other on one line."""
    order = np.lexsort((places_along(line, ends)[:, 0], line))
    after, before = order[1:], order[:-1]
    same = line[after] == line[before]
    starts, stops = ends[before[same], 1], ends[after[same], 0]
    widths = np.einsum("nk,nk->n", stops - starts, directions(ends[before[same]]))
    chosen = (widths > 1e-6) & (widths <= door)
    return np.stack([starts[chosen], stops[chosen]], axis=1)


def directions(ends: FloatArray) -> Points:
    """(P, 2) unit, from the first end of each piece (P, 2, 2) to its second."""
    way = ends[:, 1] - ends[:, 0]
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))


def places_along(line: NDArray[np.int32], ends: FloatArray) -> FloatArray:
    """(P, 2) m, places of both ends along the pieces' own lines, all of one line in one direction."""
    _, first, row = np.unique(line, return_index=True, return_inverse=True)
    way = directions(ends)[first][row]
    return np.asarray(np.einsum("nek,nk->ne", ends, way))


def _arrangement(
    line: NDArray[np.int32], ends: FloatArray, reach: float
) -> tuple[NDArray[np.object_], NDArray[np.object_]]:
    """Cells (polygons) and edges (segments) of the walls' lines, each `reach` m longer at both ends."""
    places = places_along(line, ends)
    rows = []
    for number in np.unique(line):
        own = line == number
        low, high = places[own, 0].min() - reach, places[own, 1].max() + reach
        first = np.flatnonzero(own)[0]
        way = directions(ends[first : first + 1])[0]
        foot = ends[first, 0] - (ends[first, 0] @ way) * way
        rows.append([foot + low * way, foot + high * way])
    noded = shapely.node(shapely.MultiLineString(rows))
    edges = shapely.get_parts(noded)
    cells = shapely.get_parts(shapely.polygonize(edges))
    return cells, edges


def _merge_open(
    cells: NDArray[np.object_], edges: NDArray[np.object_], closed: FloatArray
) -> NDArray[np.int64]:
    """(N,) group of each cell; -1 for those that nothing parts from the outside."""
    coordinates = np.array([np.asarray(edge.coords)[[0, -1]] for edge in edges])
    way = directions(coordinates)
    middle = coordinates.mean(axis=1)
    aside = 1e-4 * np.column_stack([-way[:, 1], way[:, 0]])
    left, right = (_cell_at(cells, middle + side * aside) for side in (1.0, -1.0))
    open_edge = ~_is_closed(coordinates, closed)
    outside = len(cells)
    a, b = (np.where(side < 0, outside, side)[open_edge] for side in (left, right))
    links = coo_array((np.ones(len(a)), (a, b)), (outside + 1, outside + 1))
    _, group = connected_components(links, directed=False)
    return np.where(group[:-1] == group[-1], -1, group[:-1]).astype(np.int64)


def _cell_at(cells: NDArray[np.object_], places: Points) -> NDArray[np.int64]:
    """(N,) number of the cell that holds each place; -1 outside of all."""
    found = np.full(len(places), -1)
    place, cell = STRtree(cells).query(shapely.points(places), predicate="within")
    found[place] = cell
    return found


def _is_closed(segments: FloatArray, closed: FloatArray) -> NDArray[np.bool_]:
    """(N,) whether wall or door covers most of each segment (N, 2, 2)."""
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    counts = np.maximum(np.ceil(lengths / _SAMPLE_M), 1.0).astype(np.int64)
    row = np.repeat(np.arange(len(segments)), counts)
    place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[row])[:, None]
    samples = segments[row, 0] + share * (segments[row, 1] - segments[row, 0])
    tree = STRtree([LineString(segment) for segment in closed])
    hit, _ = tree.query(shapely.points(samples), predicate="dwithin", distance=_ON_WALL_M)
    covered = np.zeros(len(samples))
    covered[hit] = 1.0
    return np.asarray(np.bincount(row, covered) / counts >= _CLOSED_SHARE)


def _tidy(shape: BaseGeometry) -> Polygon | None:
    """One polygon, counter-clockwise, without slivers, holes and corners that are none."""
    opened = shape.buffer(-_SLIVER_M, join_style="mitre").buffer(
        2.0 * _SLIVER_M, join_style="mitre"
    )
    parts = shapely.get_parts(opened.buffer(-_SLIVER_M, join_style="mitre"))
    largest = max(parts, key=lambda part: float(part.area), default=None)
    if largest is None or not largest.area:
        return None
    outer = Polygon(largest.exterior).simplify(_SLIVER_M / 2.0)
    return orient(outer) if isinstance(outer, Polygon) and outer.area else None


def _seen_share(polygon: Polygon, floor_map: FloorMap) -> float:
    """Share of the area that the map calls free."""
    rows, columns = np.nonzero(floor_map.free)
    places = np.column_stack([columns, rows]) + 0.5
    x, y = (np.array(floor_map.origin) + places * floor_map.resolution).T
    inside = shapely.contains_xy(polygon, x, y)
    return float(inside.sum() * floor_map.resolution**2 / max(polygon.area, math.ulp(1.0)))
