"""Ranges as the linear factors that touch their costs at one estimate."""

from __future__ import annotations

from collections.abc import Iterator

import gtsam
import numpy as np

from ..model.geometry import FloatArray
from . import factors
from .ranges import RangeCosts, RangeTable, WeighedRanges
from .variables import Indices, Places, Variables

Row = tuple[int, FloatArray, int, FloatArray, int, FloatArray, FloatArray]
"""Key and block (1, n) of the first end, of the second, and of the offset; the right side (1,)."""
Ends = list[tuple[int, int, int]]
"""Keys of both ends of each range, and of its offset."""


def range_ends(table: RangeTable, indices: Indices) -> Ends:
    """GTSAM's keys of what each range depends on."""
    stations = [factors.X(indices.stations[name]) for name in table.stations]
    anchors = [factors.L(indices.anchors[name]) for name in table.anchors]
    offsets = [factors.D(indices.anchors[name]) for name in table.anchors]
    points, count = stations + anchors, len(stations)
    return [
        (points[one], points[other], offsets[other - count] if one < count else factors.OFFSET_KEY)
        for one, other in zip(table.first.tolist(), table.second.tolist(), strict=True)
    ]


def feed_rows(
    table: RangeTable, here: RangeCosts, curvatures: FloatArray, places: Places, ends: Ends
) -> Iterator[Row]:
    """``0.5 |sum of block delta - right|^2`` of each range, which touches its cost here.

    Args:
        table: the ranges.
        here: what they cost at `places`.
        curvatures: (R,) 1/m^2, positive, by the error.
        places: the estimate.
        ends: the ranges' keys.
    """
    roots = np.sqrt(curvatures)
    second = here.spans.directions * roots[:, None]
    first = list(_first_ends(table, places, second)[:, None, :])
    for row in np.flatnonzero(table.first >= len(table.stations)):
        first[row] = -second[row : row + 1]
    if not ends:
        return iter(())
    ones, others, offsets = zip(*ends, strict=True)
    rights = (here.slopes / roots)[:, None]
    blocks = first, others, second[:, None, :], offsets, roots[:, None, None], rights
    return zip(ones, *blocks, strict=True)


def feed_ranges(
    ranges: WeighedRanges, present: Variables, at: gtsam.Values, indices: Indices, safe: bool
) -> list[gtsam.NonlinearFactor]:
    """One linear factor a range that touches its cost at the present estimate, as iSAM2 is given it.

    Args:
        ranges: with the density of their errors.
        present: the estimate.
        at: the same for GTSAM.
        indices: of the problem.
        safe: with a curvature that the cost nowhere exceeds.
    """
    table, places = ranges.table, ranges.table.places(present)
    here, ends = ranges.expand(places), range_ends(ranges.table, indices)
    rows = feed_rows(table, here, ranges.let_in(here, safe), places, ends)
    unit = gtsam.noiseModel.Unit.Create(1)
    return [gtsam.LinearContainerFactor(gtsam.JacobianFactor(*row, unit), at) for row in rows]


def _first_ends(table: RangeTable, places: Places, directions: FloatArray) -> FloatArray:
    """(R, 3) derivative by the pose of the first end, in its own axes; of no use where that is an anchor.

    The direction turned, and the lever's arm; `directions` (R, 2) may be scaled.
    """
    station = np.minimum(table.first, len(table.stations) - 1)
    turns = places.poses[station, 2]
    c, s = np.cos(turns), np.sin(turns)
    along = c * directions[:, 0] + s * directions[:, 1]
    across = c * directions[:, 1] - s * directions[:, 0]
    x, y = table.levers[station].T
    return np.column_stack([-along, -across, along * y - across * x])


def anchor_bends(
    ranges: WeighedRanges, here: RangeCosts, indices: Indices
) -> list[gtsam.HessianFactor]:
    """What the Gaussians that touch the costs leave out of the curvature by each anchor and its offset.

    With it passes are nearly Newton's steps and end in a few; without, they take thirty. Left out where
    the ranges do not hold the anchor.
    """
    table = ranges.table
    of_tag = table.first < len(table.stations)
    touching = ranges.let_in(here, safe=False)
    if not of_tag.any() or np.allclose(here.curvatures, touching):
        return []  # Gaussian errors: the steps are Gauss's, which alone end sooner
    directions = here.spans.directions
    jacobian = np.column_stack([directions, np.ones(len(directions))])
    squares = jacobian[:, :, None] * jacobian[:, None, :]
    # A range bends: its second derivative is (1 - d d^T) by its length.
    bend = np.zeros((len(directions), 3, 3))
    across = directions[:, :, None] * directions[:, None, :] - np.eye(2)
    bend[:, :2, :2] = (here.slopes / here.spans.slants)[:, None, None] * across
    missing, whole = np.zeros((2, len(table.anchors), 3, 3))
    anchors = table.second - len(table.stations)
    for blocks, weights in ((missing, here.curvatures - touching), (whole, here.curvatures)):
        rows = weights[:, None, None] * squares + bend
        np.add.at(blocks, anchors[of_tag], rows[of_tag])
    held = np.linalg.eigvalsh(whole)[:, 0] > 0.0
    return [
        factors.curvature_factor(indices.anchors[name], block)
        for name, block, keep in zip(table.anchors, missing, held, strict=True)
        if keep
    ]
