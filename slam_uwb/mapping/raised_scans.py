"""The heading of a scan taken at the same place higher up.

The operator raises the scanner and puts it back at any heading; its place is that of the station.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import PreparedScan

_TURNS = 360
"""Headings tried at first, a degree apart."""
_AGREES_M = 0.15
"""Ranges of both heights that differ by less saw the same wall."""
_LEAST_AGREEING = 0.25
"""Share of the bearings in which they must: below it the heading is a guess."""


def station_T_raised(scan: PreparedScan, raised: PreparedScan) -> Pose2 | None:
    """The turn in which most ranges of the raised scan are those of the station's own; None where few are.

    Furniture hides walls from the lower scan and lintels close doors in the upper one; what is left
    agrees in one heading. In a room that looks the same in several, any of them gives the same walls.
    """
    lower, upper = _profile(scan), _profile(raised)
    if not len(lower[0]) or not len(upper[0]):
        return None
    degrees = np.radians(np.arange(_TURNS) - _TURNS / 2.0)
    table = np.interp(degrees, *lower, period=2.0 * math.pi)
    nearest = np.round(np.degrees(upper[0]) + _TURNS / 2.0).astype(np.int64)
    shifts = np.arange(_TURNS)
    coarse = _misfit(table[(shifts[:, None] + nearest) % _TURNS], upper[1])
    fine = math.radians(int(np.argmin(coarse))) + np.radians(np.arange(-1.0, 1.001, 0.05))
    costs = _misfit(np.interp(fine[:, None] + upper[0], *lower, period=2.0 * math.pi), upper[1])
    turn = float(fine[int(np.argmin(costs))])
    # A bearing that disagrees costs 1, one that agrees less.
    return Pose2(0.0, 0.0, turn) if 1.0 - costs.min() >= _LEAST_AGREEING else None


def _profile(scan: PreparedScan) -> tuple[FloatArray, FloatArray]:
    """Bearings (N,) rad, rising, and ranges (N,) m."""
    return np.arctan2(scan.points[:, 1], scan.points[:, 0]), np.hypot(*scan.points.T)


def _misfit(seen: FloatArray, upper: FloatArray) -> FloatArray:
    """(T,) mean over the upper bearings of the difference to the (T, N) m seen below, cut off at `_AGREES_M`."""
    return np.asarray(np.minimum(np.abs(seen - upper) / _AGREES_M, 1.0).mean(axis=1))
