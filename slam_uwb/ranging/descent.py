"""The least value of a function of a few parameters that has bends: BFGS with a patient stop.

Evidence is smooth only in parts: its Hessians are kept from falling below a floor. At a bend the
searches of libraries try twenty points of one line, each with its gradient; here a gradient is taken
only where a step was good.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..model.geometry import FloatArray

_MAX_STEPS = 40
_LONGEST_STEP = 1.0
_SMALLEST_SHARE = 1.0 / 256.0
"""Of a step: where so little of it is no better, nothing along it is."""
_SUFFICIENT = 0.1
"""Share of the decrease that the slope promises."""
_DIFFERENCE = 1e-4
_STILL = 1e-10
"""Ends where a step promises less."""


def descend(
    cost: Callable[[FloatArray], float], start: FloatArray, bound: float
) -> tuple[FloatArray, float]:
    """Where the cost is least, near the start and within the bound, and how much it is there.

    Args:
        cost: of (N,) parameters, whose scale is one: second derivatives of one are a fair first guess.
        start: (N,)
        bound: no parameter is larger, to either side.
    """
    place = np.clip(start, -bound, bound)
    here, inverse = cost(place), np.eye(len(start))
    slope = _gradient(cost, place, here)
    for _ in range(_MAX_STEPS):
        # At the bound only steps away from it count.
        free = (np.abs(place) < bound) | (slope * place > 0.0)
        if not free.any():
            break
        step = np.zeros(len(place))
        step[free] = -inverse[np.ix_(free, free)] @ slope[free]
        step *= min(1.0, _LONGEST_STEP / max(float(np.linalg.norm(step)), 1e-12))
        if -float(slope @ step) < _STILL:
            break
        found = _along(cost, place, here, step, float(slope @ step), bound)
        if found is None:
            break
        new, there = found
        new_slope = _gradient(cost, new, there)
        inverse = _updated(inverse, new - place, new_slope - slope)
        place, here, slope = new, there, new_slope
    return place, here


def _along(
    cost: Callable[[FloatArray], float],
    place: FloatArray,
    here: float,
    step: FloatArray,
    slope: float,
    bound: float,
) -> tuple[FloatArray, float] | None:
    """The first of ever smaller shares of the step that gains enough, and the cost there."""
    share = 1.0
    while share >= _SMALLEST_SHARE:
        trial = np.clip(place + share * step, -bound, bound)
        there = cost(trial)
        if there < here + _SUFFICIENT * share * slope:
            return trial, there
        share /= 2.0
    return None


def _gradient(cost: Callable[[FloatArray], float], place: FloatArray, here: float) -> FloatArray:
    """(N,) by forward differences."""
    moved = place + _DIFFERENCE * np.eye(len(place))
    return np.array([cost(row) - here for row in moved]) / _DIFFERENCE


def _updated(inverse: FloatArray, moved: FloatArray, changed: FloatArray) -> FloatArray:
    """The inverse Hessian that also explains the last change of the slope (BFGS)."""
    along = float(moved @ changed)
    if along < 1e-3 * float(moved @ moved):
        return inverse
    turn = np.eye(len(moved)) - np.outer(moved, changed) / along
    return np.asarray(turn @ inverse @ turn.T + np.outer(moved, moved) / along)
