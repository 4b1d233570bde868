"""Which way the walls of one scan run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import rotation_matrix
from ..model.products import PreparedScan

# Normals less certain than this mislead more than they help (library facts, 7).
_MAX_SLOPE_VARIANCE = 0.01


def certain_normals(scan: PreparedScan) -> NDArray[np.bool_]:
    """(N,) points whose normal can be trusted."""
    return scan.normal_variance <= _MAX_SLOPE_VARIANCE


def aligning_turn(scan: PreparedScan) -> float:
    """Direction, rad, of the walls in the scanner's frame, that of the four in which most of the walls lie."""
    angle = wall_angle(scan)
    ahead, left = (scan.lengths @ scan.points) @ rotation_matrix(angle)
    return angle + 0.5 * math.pi * round(math.atan2(left, ahead) / (0.5 * math.pi))


def wall_angle(scan: PreparedScan) -> float:
    """Dominant wall direction modulo 90 degrees, in [-pi/4, pi/4) rad.

    Peak of the length-weighted histogram of wall directions, refined by the circular mean around
    it.
    """
    certain = certain_normals(scan)
    if not certain.any():
        return 0.0
    quarter = 0.5 * math.pi
    angles = np.arctan2(scan.normals[certain, 1], scan.normals[certain, 0]) % quarter
    weights = scan.lengths[certain]
    bins = 360
    histogram = np.bincount(
        (angles / quarter * bins).astype(int) % bins, weights=weights, minlength=bins
    )
    # +-1.5 degrees of smoothing: a wall's normals scatter by about a degree.
    kernel = np.zeros(bins)
    kernel[np.arange(-6, 7)] = 1.0
    smooth = np.fft.irfft(np.fft.rfft(histogram) * np.fft.rfft(kernel), bins)
    peak = (int(np.argmax(smooth)) + 0.5) * quarter / bins
    away = np.remainder(angles - peak + 0.5 * quarter, quarter) - 0.5 * quarter
    near = np.abs(away) < math.radians(2.0)
    mean = peak + (np.average(away[near], weights=weights[near]) if near.any() else 0.0)
    return float(np.remainder(mean + 0.5 * quarter, quarter) - 0.5 * quarter)
