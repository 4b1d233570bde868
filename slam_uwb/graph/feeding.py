"""Ranges as the linear factors that touch their costs at the present estimate."""

from __future__ import annotations

import gtsam
import numpy as np

from ..model.geometry import FloatArray
from . import factors
from .ranges import RangeTable, WeighedRanges
from .variables import Indices, Variables


def feed_ranges(
    ranges: WeighedRanges, present: Variables, at: gtsam.Values, indices: Indices, safe: bool
) -> list[gtsam.NonlinearFactor]:
    """One linear factor a range that touches its cost at the present estimate.

    Args:
        ranges: with the density of their errors.
        present: the estimate.
        at: the same for GTSAM.
        indices: of the problem.
        safe: with a curvature that the cost nowhere exceeds.
    """
    table = ranges.table
    _, slopes, curvatures = ranges.touching(present, safe)
    roots = np.sqrt(curvatures)
    second = table.directions(present) * roots[:, None]
    first, unit = _first_ends(table, present, second), gtsam.noiseModel.Unit.Create(1)
    right, offset = (slopes / roots)[:, None], roots[:, None]
    stations = [factors.X(indices.stations[name]) for name in table.stations]
    anchors = [factors.L(indices.anchors[name]) for name in table.anchors]
    offsets = [factors.D(indices.anchors[name]) for name in table.anchors]
    fed: list[gtsam.NonlinearFactor] = []
    ends = zip(table.first.tolist(), table.second.tolist(), strict=True)
    for row, (one, other) in enumerate(ends):
        at_row, other = slice(row, row + 1), other - len(stations)
        if one < len(stations):
            keys, block = (stations[one], anchors[other], offsets[other]), first[at_row]
        else:
            between = anchors[one - len(stations)]
            keys, block = (between, anchors[other], factors.OFFSET_KEY), -second[at_row]
        blocks = (block, second[at_row], offset[at_row])
        fed.append(factors.linear_factor(keys, blocks, right[row], unit, at))
    return fed


def _first_ends(table: RangeTable, present: Variables, directions: FloatArray) -> FloatArray:
    """(R, 3) derivative by the pose of the first end, in its own axes; of no use where that is an anchor.

    The direction turned, and the lever's arm; `directions` (R, 2) may be scaled.
    """
    station = np.minimum(table.first, len(table.stations) - 1)
    turns = np.array([present.poses[name].theta for name in table.stations])[station]
    c, s = np.cos(turns), np.sin(turns)
    along = c * directions[:, 0] + s * directions[:, 1]
    across = c * directions[:, 1] - s * directions[:, 0]
    x, y = table.levers[station].T
    return np.column_stack([-along, -across, along * y - across * x])


def anchor_bends(
    ranges: WeighedRanges, present: Variables, at: gtsam.Values, indices: Indices
) -> list[gtsam.NonlinearFactor]:
    """What the Gaussians that touch the costs leave out of the curvature by each anchor and its offset.

    With it passes are nearly Newton's steps and end in a few; without, they take thirty. Left out where
    the ranges do not hold the anchor.
    """
    table = ranges.table
    of_tag = table.first < len(table.stations)
    if not of_tag.any():
        return []
    residuals, slopes, touching = ranges.touching(present, safe=False)
    curvatures = ranges.density.expand(residuals)[2]
    if np.allclose(curvatures, touching):
        return []  # Gaussian errors: the steps are Gauss's, which alone end sooner
    directions = table.directions(present)
    jacobian = np.column_stack([directions, np.ones(len(directions))])
    squares = jacobian[:, :, None] * jacobian[:, None, :]
    # A range bends: its second derivative is (1 - d d^T) by its length.
    bend = np.zeros((len(directions), 3, 3))
    across = directions[:, :, None] * directions[:, None, :] - np.eye(2)
    bend[:, :2, :2] = (slopes / table.slants(present))[:, None, None] * across
    missing, whole = np.zeros((2, len(table.anchors), 3, 3))
    anchors = table.second - len(table.stations)
    for blocks, weights in ((missing, curvatures - touching), (whole, curvatures)):
        rows = weights[:, None, None] * squares + bend
        np.add.at(blocks, anchors[of_tag], rows[of_tag])
    held = np.linalg.eigvalsh(whole)[:, 0] > 0.0
    return [
        factors.curvature_factor(indices.anchors[name], block, at)
        for name, block, keep in zip(table.anchors, missing, held, strict=True)
        if keep
    ]
