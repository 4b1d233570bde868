"""Correlation grids of one scan in its wall-aligned frame, and their spectra."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, rotation_matrix
from ..model.products import PreparedScan
from ..model.settings import MatchingSettings
from .directions import certain_normals

DIRECTIONS = 360
"""Bins of the histogram of wall directions."""
BLOCK = 3
"""Cells along an edge of the blocks of the correlation grid that may hold one peak each."""


@dataclass(frozen=True, slots=True, eq=False)
class Spectra:
    """Correlation grids of one scan in its wall-aligned frame, as half spectra at quarter turns 0 and 1."""

    occupied: NDArray[np.complex128]
    """(2, G, G // 2 + 1)."""
    contrast: NDArray[np.complex128]
    """(2, G, G // 2 + 1), blurred occupied cells minus free ones."""
    directions: NDArray[np.complex128]
    """(D // 2 + 1,) spectrum of the smoothed histogram of wall directions in the axes of the walls,
    all the way round."""


def grid_size(settings: MatchingSettings) -> int:
    """Cells along an edge of the correlation grid; wraps round at twice the radius, which scoring sorts out.

    A whole number of blocks of cells that has small prime factors.
    """
    from scipy.fft import next_fast_len

    blocks = math.ceil(2.0 * settings.correlation_radius_m / settings.correlation_cell_m / BLOCK)
    return BLOCK * int(next_fast_len(blocks, real=True))


def grid_spectra(scan: PreparedScan, angle: float, settings: MatchingSettings) -> Spectra:
    """Spectra of a scan whose walls run in the direction `angle` (rad, scanner's frame)."""
    from scipy.fft import rfft2

    grids = correlation_grids(scan, angle, settings)
    # Turning by 90 degrees maps cell (row, column) to (column, -row); half turns are conjugate
    # spectra.
    turned = np.roll(np.flip(grids.transpose(0, 2, 1), axis=2), 1, axis=2)
    spectra = rfft2(np.stack([grids, turned], axis=1))
    return Spectra(spectra[0], spectra[1], _direction_spectrum(scan, angle))


def _direction_spectrum(scan: PreparedScan, angle: float) -> NDArray[np.complex128]:
    certain = certain_normals(scan)
    normals = scan.normals[certain] @ rotation_matrix(angle)
    bins = np.floor((np.arctan2(normals[:, 1], normals[:, 0]) / (2.0 * math.pi)) * DIRECTIONS)
    histogram = np.bincount(
        bins.astype(int) % DIRECTIONS, weights=scan.lengths[certain], minlength=DIRECTIONS
    )
    kernel = np.zeros(DIRECTIONS)
    kernel[np.arange(-2, 3)] = 1.0
    return np.asarray(np.fft.rfft(histogram) * np.fft.rfft(kernel))


def correlation_grids(scan: PreparedScan, angle: float, settings: MatchingSettings) -> FloatArray:
    """(2, G, G) occupied cells and contrast of a scan whose direction `angle` lies along x."""
    from scipy.ndimage import gaussian_filter

    size = grid_size(settings)
    occupied = np.zeros((size, size))
    near = np.hypot(*scan.points.T) < settings.correlation_radius_m
    cells = np.rint(
        scan.points[near] @ rotation_matrix(angle) / settings.correlation_cell_m
    ).astype(int)
    occupied[cells[:, 1], cells[:, 0]] = 1.0  # negative cells wrap: the grid is centred on cell 0
    contrast = gaussian_filter(occupied, 0.8, mode="wrap") - _free_cells(
        scan, angle, size, settings
    )
    return np.stack([occupied, contrast])


def _free_cells(
    scan: PreparedScan, angle: float, size: int, settings: MatchingSettings
) -> FloatArray:
    """(G, G) 1 where the scanner looked through the cell, in the wall-aligned frame centred on cell 0."""
    steps = np.fft.fftfreq(size, 1.0 / size) * settings.correlation_cell_m
    x, y = np.meshgrid(steps, steps)
    count = len(scan.free_ranges)
    bearing = np.arctan2(y, x) + angle + math.pi
    sector = (
        np.floor(np.remainder(bearing, 2.0 * math.pi) * (count / (2.0 * math.pi))).astype(int)
        % count
    )
    margin = settings.free_space_margin_m
    return np.asarray(np.hypot(x, y) < scan.free_ranges[sector] - margin, dtype=np.float64)
