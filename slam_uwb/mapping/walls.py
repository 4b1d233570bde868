"""Scans and poses -> pieces of wall that a radio path may cross.

Walls are pieces of the straight lines that segments of several scans share. What is between the
segments, door or wall behind a cupboard, the beams of all scans tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import PreparedScan, WallPieces
from ..model.settings import MappingSettings
from ..model.survey import StationId
from .raised_scans import station_T_raised
from .wall_belief import (
    chain_probability,
    support_of_both_faces,
    support_round_bends,
    wall_probability,
)
from .wall_corners import corner_gaps
from .wall_evidence import PlacedScan, WallCells, wall_cells
from .wall_lines import WallLines, common_lines
from .wall_runs import WallRuns, wall_runs

_MAYBE_WALL = 0.3
"""What is less likely a wall is not continued to a corner, and ends no other wall."""


def find_walls(
    scans: Mapping[StationId, PreparedScan],
    poses: Mapping[StationId, Pose2],
    settings: MappingSettings,
    upper_scans: Mapping[StationId, PreparedScan] | None = None,
) -> WallPieces:
    """Pieces of wall and of furniture that the placed scans saw, or that hide behind furniture.

    The order of the scans does not matter, nor does the frame.

    Args:
        scans: Prepared scans, in the scanner's frame.
        poses: `world_T_station`; a scan without a pose and a pose without a scan are left out.
        settings: `wall_...`.
        upper_scans: Prepared scans taken above the furniture at the same places, each in its own
            frame: their headings are found here. They tell walls from furniture; doors are told by
            `scans`.

    Returns:
        Pieces in the world frame, by line and place; none without any scan.
    """
    names = [name for name in sorted(scans) if name in poses]
    # In the frame of the first station, so that cells lie the same whatever the world's is.
    world_T_first = poses[names[0]] if names else Pose2.identity()
    poses = {name: world_T_first.inverse() @ poses[name] for name in names}
    placed = [(poses[name], scans[name]) for name in names]
    raised = _raised(scans, poses, upper_scans or {})
    segments = [_seen_from_left(pose, scan) for pose, scan in (*placed, *raised)]
    lines = common_lines(
        np.concatenate([np.empty((0, 2, 2)), *segments]),
        math.radians(settings.wall_angle_deg),
        settings.wall_distance_m,
    )
    cells = wall_cells(lines, placed, raised, settings)
    runs = wall_runs(cells, settings)
    runs = replace(runs, support=support_round_bends(runs, lines))
    runs = replace(runs, support=support_of_both_faces(runs, lines, settings))
    runs = _with_corners(runs, lines, cells, settings)
    ends = world_T_first.transform(runs.ends(lines).reshape(-1, 2)).reshape(-1, 2, 2)
    return WallPieces(ends, runs.line.astype(np.int32), wall_probability(runs, lines, settings))


def _raised(
    scans: Mapping[StationId, PreparedScan],
    poses: Mapping[StationId, Pose2],
    upper_scans: Mapping[StationId, PreparedScan],
) -> Sequence[PlacedScan]:
    """The upper scans whose heading is found."""
    both = [name for name in sorted(upper_scans) if name in scans and name in poses]
    turns = [(name, station_T_raised(scans[name], upper_scans[name])) for name in both]
    return [(poses[name] @ turn, upper_scans[name]) for name, turn in turns if turn is not None]


def _seen_from_left(world_T_scan: Pose2, scan: PreparedScan) -> FloatArray:
    """(S, 2, 2) m, the scan's segments in the world, turned so that the scanner is on the left."""
    start, end = scan.segments[:, 0], scan.segments[:, 1]
    left = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0] > 0.0
    turned = np.where(left[:, None, None], scan.segments, scan.segments[:, ::-1])
    return world_T_scan.transform(turned.reshape(-1, 2)).reshape(-1, 2, 2)


def _with_corners(
    runs: WallRuns, lines: WallLines, cells: WallCells, settings: MappingSettings
) -> WallRuns:
    """The runs, and what is hidden between walls and the walls that they end at."""
    likely = np.maximum(chain_probability(runs.support, settings), runs.raised) > _MAYBE_WALL
    walls = likely & (runs.raised >= 0.0)
    run, span = corner_gaps(runs, walls, lines, cells, settings)
    hidden = replace(
        runs.part(run),
        span=span,
        seen=np.zeros(len(run), dtype=np.bool_),
        raised=np.maximum(runs.raised[run], 0.0),
    )
    joined = runs.joined(hidden)
    return joined.part(np.lexsort((joined.span[:, 0], joined.line)))
