"""Degrees of the files <-> radians inside, (-pi, pi], without losing a bit on the way there and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..model.geometry import FloatArray


def radians_from_degrees(degrees: ArrayLike) -> FloatArray:
    """Radians in (-pi, pi], same shape; NaN stays NaN. Whole turns are taken off exactly (fmod)."""
    turned = np.fmod(np.asarray(degrees, dtype=np.float64), 360.0)
    turned = np.where(turned > 180.0, turned - 360.0, turned)
    return np.deg2rad(np.where(turned <= -180.0, turned + 360.0, turned))


def degrees_from_radians(radians: ArrayLike) -> FloatArray:
    """Degrees in (-180, 180], same shape, that `radians_from_degrees` turns into the very same floats.

    Where no float of degrees does (possible for radians that never were degrees), the nearest: it returns
    within one unit in the last place.
    """
    wanted = np.asarray(radians, dtype=np.float64)
    first = np.rad2deg(wanted)
    best = first.copy()
    for direction in (-np.inf, np.inf):
        candidate = first
        for _ in range(2):
            candidate = np.nextafter(candidate, direction)
            better = (radians_from_degrees(candidate) == wanted) & (
                radians_from_degrees(best) != wanted
            )
            best = np.where(better, candidate, best)
    return best
