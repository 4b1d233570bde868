"""What the scans say of each decimetre of a wall line: hit, looked through, or nothing.

The occupancy grid asks the same of squares; along a line it is sharper, since a grazing beam that
ends on the wall is no evidence against the wall beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.products import PreparedScan
from ..model.settings import MappingSettings
from .ragged import ragged
from .wall_lines import WallLines

_FACING = math.cos(math.radians(35.0))
"""The surface at a hit and the line differ by less: a wall that ends at the line is no hit of it."""
_WIDEST_BEAM_M = 0.15
"""A beam that passes speaks for at most so much of the line to each side, however far it came."""


@dataclass(frozen=True, slots=True, eq=False)
class WallCells:
    """All lines cut into cells, one line's cells after the other's."""

    line: NDArray[np.int64]
    """(C,) number of the line."""
    start: FloatArray
    """(C,) m along the line's direction, where the cell begins."""
    first_hit: FloatArray
    """(C,) m, the least place in the cell where a stretch seen in one piece begins; infinite where none does."""
    last_hit: FloatArray
    """(C,) m, the largest place in the cell where one ends; minus infinite where none does."""
    wall: NDArray[np.bool_]
    """(C,) where scans saw a wall, or raised ones did and the others neither saw one nor looked through."""
    free: NDArray[np.bool_]
    """(C,) where scans looked through, or raised ones did and the others know nothing."""
    raised_wall: NDArray[np.bool_]
    """(C,) where raised scans saw a wall, lintels included."""
    raised_free: NDArray[np.bool_]
    """(C,) where raised scans looked over what is here."""


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """Scans that say something of the cells, counted, and where what they saw begins and ends."""

    hits: NDArray[np.int32]
    passes: NDArray[np.int32]
    first_hit: FloatArray
    last_hit: FloatArray

    @property
    def wall(self) -> NDArray[np.bool_]:
        """(C,) seen; a scan that saw a wall outweighs one that passed: poses err."""
        return np.asarray(2 * self.hits > self.passes)

    @property
    def free(self) -> NDArray[np.bool_]:
        """(C,) looked through."""
        return np.asarray((self.passes > 0) & ~self.wall)


@dataclass(frozen=True, slots=True, eq=False)
class _Meetings:
    """Beams of one scan that meet lines: sorted by line, then bearing."""

    line: NDArray[np.int64]
    ray: NDArray[np.int64]
    crossing: FloatArray
    """m along the line, where the beam crosses it."""
    place: FloatArray
    """m along the line, the foot of the beam's end."""
    beyond: FloatArray
    """m by which the beam's end lies behind the line, seen from the scanner; negative before it."""
    incidence: FloatArray
    """Sine of the angle between beam and line, 0-1."""
    distance: FloatArray
    """m from the scanner to the crossing."""
    in_front: NDArray[np.bool_]
    """Whether the scanner stands on the side from which the line was seen."""


PlacedScan: TypeAlias = tuple[Pose2, PreparedScan]
"""`world_T_scan` and the scan."""


def wall_cells(
    lines: WallLines,
    placed: Sequence[PlacedScan],
    raised: Sequence[PlacedScan],
    settings: MappingSettings,
) -> WallCells:
    """Evidence along the lines and as far beyond their ends as gaps are filled.

    Raised scans see walls without furniture, but doors closed by what is above them; so a door is
    what the others looked through, and what raised scans looked over is furniture.

    Args:
        lines: In the world frame.
        placed: Scans at the height of the tag; each counts once a cell.
        raised: Scans above the furniture.
        settings: `wall_...`.
    """
    # Half a cell more: where a line begins is a place of a hit, which must not be the edge of a cell.
    margin = settings.wall_fill_gap_m + settings.wall_cell_m / 2.0
    begin = lines.reach[:, 0] - margin
    spans = lines.reach[:, 1] + margin - begin
    counts = np.ceil(spans / settings.wall_cell_m).astype(np.int64)
    line, place = ragged(counts)
    low = _evidence(lines, begin, counts, placed, settings)
    high = _evidence(lines, begin, counts, raised, settings)
    return WallCells(
        line=line,
        start=begin[line] + place * settings.wall_cell_m,
        first_hit=np.where(low.wall, low.first_hit, high.first_hit),
        last_hit=np.where(low.wall, low.last_hit, high.last_hit),
        wall=low.wall | (high.wall & ~low.free),
        free=low.free | (high.free & ~low.wall),
        raised_wall=high.wall,
        raised_free=high.free,
    )


def _evidence(
    lines: WallLines,
    begin: FloatArray,
    counts: NDArray[np.int64],
    placed: Sequence[PlacedScan],
    settings: MappingSettings,
) -> _Evidence:
    """What scans of one height say of the `counts` cells of each line, from `begin` m on."""
    cell, total = settings.wall_cell_m, int(counts.sum())
    first = np.cumsum(counts) - counts
    hits, passes = np.zeros(total, dtype=np.int32), np.zeros(total, dtype=np.int32)
    first_hit, last_hit = np.full(total, np.inf), np.full(total, -np.inf)

    def cell_of(on: NDArray[np.int64], at: FloatArray) -> NDArray[np.int64]:
        """The cell at a place on a line, or the line's nearest."""
        return first[on] + np.clip(((at - begin[on]) / cell).astype(np.int64), 0, counts[on] - 1)

    for world_T_scan, scan in placed:
        met = _meetings(lines, begin, begin + counts * cell, world_T_scan, scan)
        on, low, high = _hit_stretches(met, lines, world_T_scan, scan, settings)
        from_cell, to_cell = cell_of(on, low), cell_of(on, high)
        hit = _covered(from_cell, to_cell, total)
        np.minimum.at(first_hit, from_cell, low)
        np.maximum.at(last_hit, to_cell, high)
        on, low, high = _passed_stretches(met, scan, settings)
        # The edge of a door is hit and passed by one scan: the wall reaches as far as it was seen.
        passed = _covered(cell_of(on, low), cell_of(on, high), total) & ~hit
        hits += hit
        passes += passed
    return _Evidence(hits, passes, first_hit, last_hit)


def _covered(
    from_cell: NDArray[np.int64], to_cell: NDArray[np.int64], count: int
) -> NDArray[np.bool_]:
    """(C,) the cells from any of the first to the second."""
    steps = np.bincount(from_cell, minlength=count + 1) - np.bincount(
        to_cell + 1, minlength=count + 1
    )
    return np.asarray(np.cumsum(steps)[:count] > 0)


def _meetings(
    lines: WallLines, low: FloatArray, high: FloatArray, pose: Pose2, scan: PreparedScan
) -> _Meetings:
    """All beams towards the stretches from `low` to `high` (L,) m of the lines."""
    numbers = np.arange(len(lines.offsets))
    height = lines.normals @ pose.translation - lines.offsets
    bearings = np.arctan2(scan.points[:, 1], scan.points[:, 0])
    ranges = np.hypot(scan.points[:, 0], scan.points[:, 1])
    local = pose.inverse()
    ends = [local.transform(lines.points(numbers, at)) for at in (low, high)]
    angles = [np.arctan2(end[:, 1], end[:, 0]) for end in ends]
    in_front = height > 0.0
    start = np.where(in_front, angles[0], angles[1])
    width = np.mod(np.where(in_front, 1.0, -1.0) * (angles[1] - angles[0]), 2.0 * math.pi)
    twice = np.concatenate([bearings, bearings + 2.0 * math.pi])
    from_ray = np.searchsorted(twice, start)
    counts = np.searchsorted(twice, start + width) - from_ray
    too_far = np.abs(height) > (ranges.max() if len(ranges) else 0.0) + 0.5
    line, step = ragged(np.where(too_far, 0, counts))
    ray = (from_ray[line] + step) % max(len(bearings), 1)

    rays = bearings[ray] + pose.theta
    beam = np.column_stack([np.cos(rays), np.sin(rays)])
    towards = np.einsum("ij,ij->i", beam, lines.normals[line]) * np.where(in_front[line], -1.0, 1.0)
    along = np.einsum("ij,ij->i", beam, lines.directions[line])
    foot = (lines.directions @ pose.translation)[line]
    incidence = np.maximum(towards, 1e-9)
    distance = np.abs(height)[line] / incidence
    return _Meetings(
        line=line,
        ray=ray,
        crossing=foot + distance * along,
        place=foot + ranges[ray] * along,
        beyond=ranges[ray] * incidence - np.abs(height)[line],
        incidence=incidence,
        distance=distance,
        in_front=in_front[line],
    )


def _hit_stretches(
    met: _Meetings, lines: WallLines, pose: Pose2, scan: PreparedScan, settings: MappingSettings
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Lines and stretches on them that the scan saw: points, and what lies between neighbours."""
    normals = scan.normals @ pose.rotation.T
    same_way = np.einsum("ij,ij->i", normals[met.ray], lines.normals[met.line]) > _FACING
    hit = met.in_front & same_way & (np.abs(met.beyond) <= settings.wall_distance_m)
    hit[hit] = _strongest(met.ray[hit], met.line[hit], met.beyond[hit], lines, settings)
    line, ray, place = met.line[hit], met.ray[hit], met.place[hit]
    ranges = np.hypot(scan.points[:, 0], scan.points[:, 1])
    bin_width = 2.0 * math.pi / max(len(scan.free_ranges), 1)
    # Neighbours in bearing with no gap between them: the same rule that makes them one segment.
    gap = np.maximum(settings.wall_neighbour_gap_m, 3.0 * bin_width * ranges[ray])
    joined = (
        (line[1:] == line[:-1])
        & (np.mod(ray[1:] - ray[:-1], max(len(ranges), 1)) == 1)
        & (np.abs(place[1:] - place[:-1]) <= gap[1:])
    )
    low = np.concatenate([place, np.minimum(place[1:], place[:-1])[joined]])
    high = np.concatenate([place, np.maximum(place[1:], place[:-1])[joined]])
    return np.concatenate([line, line[1:][joined]]), low, high


def _strongest(
    ray: NDArray[np.int64],
    line: NDArray[np.int64],
    beyond: FloatArray,
    lines: WallLines,
    settings: MappingSettings,
) -> NDArray[np.bool_]:
    """Of the lines that one point lies on, the one with most wall, or a weaker one that is nearer.

    Else a few points of a wall that a bad segment ran through make a second, slanting wall.
    """
    strength = lines.support[line] * (1.0 - (beyond / settings.wall_distance_m) ** 2)
    order = np.lexsort((line, -strength, ray))
    first = np.concatenate([[True], np.diff(ray[order]) != 0])[: len(order)]
    best = np.zeros(len(ray), dtype=np.bool_)
    best[order[first]] = True
    return best


def _passed_stretches(
    met: _Meetings, scan: PreparedScan, settings: MappingSettings
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Lines and stretches on them that the scan looked through, from either side."""
    passed = (met.beyond > settings.wall_beyond_m) & (met.incidence > settings.wall_incidence)
    line, crossing = met.line[passed], met.crossing[passed]
    bin_width = 2.0 * math.pi / max(len(scan.free_ranges), 1)
    beam = 0.5 * bin_width * met.distance[passed] / met.incidence[passed]
    half = np.minimum(beam, _WIDEST_BEAM_M)
    return line, crossing - half, crossing + half
