"""Labels that follow the places that they move: a fixed point, reached in few steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray

_MOST_MIXING = 20.0
_DEPTH = 4
"""Steps that are remembered: a few places at a time slide along walls, each at its own pace."""
_LEAST_SHARE = 1e-3
"""Of the largest step: differences of steps that are smaller against it predict nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Probabilities of the numbers of walls as solved with, and how they came about."""

    used: FloatArray
    """(R, W) of each range."""
    gap: FloatArray | None = None
    """(R, W) by how much the map's labels, at the places they had led to, differed from those before."""
    steps: tuple[tuple[FloatArray, FloatArray], ...] = ()
    """(R, W) changes of `used` and of `gap` from round to round, the last one last."""


def next_labels(told: FloatArray, before: Labels | None) -> Labels:
    """Labels to solve with next, from what the map tells (R, W) at the places that the last ones led to.

    Half-way at first: a label that depends on the place that it moves must not swing. Then by the
    last steps as far as they predict (Anderson 1965): half-way alone takes forty rounds where places
    slide along a wall.
    """
    if before is None or before.used.shape != told.shape or not np.isfinite(told).all():
        return Labels(told)
    gap = told - before.used
    steps = before.steps
    if before.gap is not None and steps:
        steps = (*steps[:-1], (steps[-1][0], gap - before.gap))
    used = before.used + 0.5 * gap if before.gap is None else before.used + _mixed(gap, steps)
    used = np.maximum(used, 0.0)
    used /= used.sum(axis=1, keepdims=True)
    return Labels(used, gap, (*steps, (used - before.used, gap))[-_DEPTH:])


def _mixed(gap: FloatArray, steps: tuple[tuple[FloatArray, FloatArray], ...]) -> FloatArray:
    """(R, W) the step to where the gap is expected to vanish."""
    moved = np.array([step.ravel() for step, _ in steps]).T
    changed = np.array([change.ravel() for _, change in steps]).T
    mixing = np.linalg.lstsq(changed, gap.ravel(), rcond=_LEAST_SHARE)[0]
    mixing = np.clip(mixing, -_MOST_MIXING, _MOST_MIXING)
    return np.asarray(gap - ((moved + changed) @ mixing).reshape(gap.shape))
