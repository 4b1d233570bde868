"""Scans and poses -> occupancy grid by ray casting.

The log-odds grid of Moravec and Elfes (1985) in the form of Thrun, Burgard and Fox, *Probabilistic
Robotics* (2005), table 9.1: what a scan says of a cell is added to what the others said. A tripod
scan is one observation (its samples were reduced over a whole recording), so it counts a cell once,
whatever the number of its beams there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from ..model.floor import FloorMap
from ..model.geometry import FloatArray, Points, Pose2
from ..model.products import PreparedScan
from ..model.settings import MappingSettings
from ..model.survey import StationId
from .ragged import ragged

Cells = NDArray[np.int64]
"""(N, 2) column and row."""


def build_floor_map(
    scans: Mapping[StationId, PreparedScan],
    poses: Mapping[StationId, Pose2],
    settings: MappingSettings,
) -> FloorMap:
    """Occupancy grid of everything that the placed scans saw.

    A cell is occupied where walls were seen, free where a beam with a return passed, and NaN where
    neither; where the scanner got no return nothing is known. The order of scans does not matter.

    Args:
        scans: Prepared scans, points in the scanner's frame.
        poses: `world_T_station`; a scan without a pose and a pose without a scan are left out.
        settings: Cell edge, border, weights.

    Returns:
        The map in the world frame. Its origin is a multiple of the cell edge, so that the same
        cells result whatever else is in the map. A map that would exceed `max_cells` has its cell
        edge doubled as often as necessary. Without any point the grid is empty, (0, 0).
    """
    placed = [
        (poses[name], scan) for name, scan in scans.items() if name in poses and len(scan.points)
    ]
    if not placed:
        return FloorMap(np.empty((0, 0)), settings.resolution_m, (0.0, 0.0))
    resolution, first, size = _frame(placed, settings)
    hits = np.zeros((size[1], size[0]), dtype=np.int32)
    passes = np.zeros_like(hits)
    for world_T_station, scan in placed:
        _count(world_T_station, scan, resolution, first, hits, passes)
    # Integers are summed, not log-odds: exactly the same map in whatever order the scans come.
    evidence = hits * settings.hit_log_odds
    evidence += passes * settings.free_log_odds
    occupancy = expit(np.clip(evidence, -settings.max_log_odds, settings.max_log_odds))
    occupancy[(hits == 0) & (passes == 0)] = np.nan
    return FloorMap(
        occupancy, resolution, (float(first[0]) * resolution, float(first[1]) * resolution)
    )


def _frame(
    placed: list[tuple[Pose2, PreparedScan]], settings: MappingSettings
) -> tuple[float, Cells, Cells]:
    """Cell edge, lower left cell (counted from the world's origin), number of columns and rows."""
    # Half the longest piece of wall that a point stands for may reach beyond the point itself.
    reach = settings.margin_m + max(float(np.max(scan.lengths)) for _, scan in placed) / 2.0
    seen = np.vstack(
        [pose.transform(np.vstack([scan.points, np.zeros((1, 2))])) for pose, scan in placed]
    )
    low, high = seen.min(axis=0) - reach, seen.max(axis=0) + reach
    resolution = settings.resolution_m
    while math.prod((high - low) / resolution + 1.0) > settings.max_cells:
        resolution *= 2.0
    first = np.floor(low / resolution).astype(np.int64)
    return resolution, first, np.floor(high / resolution).astype(np.int64) - first + 1


def _count(
    world_T_station: Pose2,
    scan: PreparedScan,
    resolution: float,
    first: Cells,
    hits: NDArray[np.int32],
    passes: NDArray[np.int32],
) -> None:
    """Add one scan to the counts, in the window of the grid that it sees."""
    ends = world_T_station.transform(wall_samples(scan, resolution)) / resolution - first
    start = world_T_station.translation / resolution - first
    hit_cells = np.floor(ends).astype(np.int64)
    free_cells = cells_passed(start, ends)
    low = np.minimum(hit_cells.min(axis=0), free_cells.min(axis=0))
    high = np.maximum(hit_cells.max(axis=0), free_cells.max(axis=0)) + 1
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    hit = np.zeros((high - low)[::-1], dtype=np.bool_)
    free = np.zeros_like(hit)
    hit[tuple((hit_cells - low).T[::-1])] = True
    free[tuple((free_cells - low).T[::-1])] = True
    hits[window] += hit
    # A beam along a wall passes the cells that its neighbours hit: the wall is there all the same.
    passes[window] += free & ~hit


def wall_samples(scan: PreparedScan, spacing: float) -> Points:
    """(M, 2) m, scanner's frame: the pieces of wall that the points stand for, `spacing` apart.

    Points one degree apart are several cells apart a few metres off; without this the wall is
    dotted and the space before it a fan of spokes. A point without a normal stays one point.
    """
    has_normal = np.any(scan.normals != 0.0, axis=1)
    gaps = np.linalg.norm(np.roll(scan.points, -1, axis=0) - scan.points, axis=1)
    # The nearer neighbour counts: a jump on the other side says that the wall ends there (a door).
    lengths = np.where(
        has_normal, np.minimum(scan.lengths, np.minimum(gaps, np.roll(gaps, 1))), 0.0
    )
    counts = np.maximum(np.ceil(lengths / spacing), 1.0).astype(np.int64)
    point, place = ragged(counts)
    along = ((place + 0.5) / counts[point] - 0.5) * lengths[point]
    tangents = scan.normals[:, ::-1] * np.array([-1.0, 1.0])
    return np.asarray(scan.points[point] + along[:, None] * tangents[point])


def cells_passed(start: FloatArray, ends: Points) -> Cells:
    """Every cell on the lines from `start` (2,) to `ends` (N, 2), but for where a line ends.

    Coordinates count cells. A line enters each cell after its first by crossing one grid line
    (Amanatides and Woo 1987), so the cells follow from the crossings, all at once and unsorted.
    Between lines at most a cell apart none is left out: a square is nowhere narrower than its edge.
    """
    # Seen along each line both axes go up; so a start on a grid line, as that of the first station
    # in its own frame, belongs to the cell that the line leaves into, whatever the direction.
    ways = np.where(ends < start, -1, 1)
    starts, ends = start * ways, ends * ways
    first, last = np.floor(starts).astype(np.int64), np.floor(ends).astype(np.int64)
    entered = [(np.arange(len(ends)), first), *(_entered(starts, ends, axis) for axis in (0, 1))]
    line = np.concatenate([lines for lines, _ in entered])
    cells = np.vstack([cells for _, cells in entered])
    passed = np.any(cells != last[line], axis=1)
    line, cells = line[passed], cells[passed]
    return np.where(ways[line] > 0, cells, -1 - cells)


def _entered(starts: Points, ends: Points, axis: int) -> tuple[NDArray[np.int64], Cells]:
    """Lines, all of them going up, and the cells they enter through grid lines across `axis`."""
    first, last = np.floor(starts).astype(np.int64), np.floor(ends).astype(np.int64)
    line, step = ragged(last[:, axis] - first[:, axis])
    cells = np.empty((len(line), 2), dtype=np.int64)
    cells[:, axis] = first[line, axis] + step + 1
    begin, move = starts[line], (ends - starts)[line]
    other = 1 - axis
    across = begin[:, other] + (cells[:, axis] - begin[:, axis]) / move[:, axis] * move[:, other]
    # Rounding at a corner must not lead out of the box that the line spans.
    cells[:, other] = np.clip(np.floor(across), first[line, other], last[line, other])
    return line, cells
