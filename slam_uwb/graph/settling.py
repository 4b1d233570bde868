"""Labels that follow the places that they move: a fixed point, reached in few steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray

_MOST_MIXING = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Probabilities of the numbers of walls as solved with, and how they came about."""

    used: FloatArray
    """(R, W) of each range."""
    moved: FloatArray
    """(R, W) by how much they differ from those of the round before."""
    gap: FloatArray
    """(R, W) by how much the map's labels, at the places they had led to, differed from those before."""


def next_labels(told: FloatArray, before: Labels | None) -> Labels:
    """Labels to solve with next, from what the map tells (R, W) at the places that the last ones led to.

    Half-way at first: a label that depends on the place that it moves must not swing. Then by the
    two last steps as far as they predict (Anderson 1965, depth one): half-way alone takes forty
    rounds where places slide along a wall.
    """
    if before is None or before.used.shape != told.shape or not np.isfinite(told).all():
        return Labels(told, np.zeros_like(told), np.zeros_like(told))
    gap = told - before.used
    change = gap - before.gap
    size = float((change**2).sum())
    if not before.gap.any() or size < 1e-24:
        used = before.used + 0.5 * gap
    else:
        mixing = float(np.clip((gap * change).sum() / size, -_MOST_MIXING, _MOST_MIXING))
        used = before.used + gap - mixing * (before.moved + change)
    used = np.maximum(used, 0.0)
    used /= used.sum(axis=1, keepdims=True)
    return Labels(used, used - before.used, gap)
