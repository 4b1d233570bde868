"""Correlation grids of one scan in its wall-aligned frame, and their spectra."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

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
_BLUR_CELLS = 0.8
# Of the radius. What is moved over the edge comes back on the other side: the end of a corridor would come to
# lie in the free space that the other scan has there, at the right place.
_FREE_REACH = 2.0 / 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Spectra:
    """Correlation grids of one scan in its wall-aligned frame, as half spectra at quarter turns 0 and 1.

    Single precision tells peaks from each other and takes a third of the time.
    """

    occupied: NDArray[np.complex64]
    """(2, G, G // 2 + 1)."""
    contrast: NDArray[np.complex64]
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


def scan_spectra(scan: PreparedScan, angle: float, settings: MatchingSettings) -> Spectra:
    """Spectra of a scan whose walls run in the direction `angle` (rad, scanner's frame)."""
    grids = _grids(scan, np.array([angle]), settings)[:, 0]
    # Turning by 90 degrees maps cell (row, column) to (column, -row); half turns are conjugate
    # spectra.
    turned = np.roll(np.flip(grids.transpose(0, 2, 1), axis=2), 1, axis=2)
    occupied, contrast = _transformed(np.stack([grids, turned], axis=1))
    return Spectra(occupied, contrast, _direction_spectrum(scan, angle))


def turned_spectra(
    scan: PreparedScan, angles: FloatArray, settings: MatchingSettings
) -> NDArray[np.complex64]:
    """(2, A, G, G // 2 + 1) occupied cells and contrast where the directions `angles` (A,), rad, lie along x."""
    return _transformed(_grids(scan, angles, settings))


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


def _transformed(grids: NDArray[np.float32]) -> NDArray[np.complex64]:
    """(2, A, G, G // 2 + 1) spectra of occupied cells and contrast, from occupied and free cells (2, A, G, G)."""
    from scipy.fft import rfft2

    occupied, free = rfft2(grids)
    size = grids.shape[-1]
    row, column = (
        np.exp(-2.0 * (math.pi * _BLUR_CELLS * frequency) ** 2)
        for frequency in (np.fft.fftfreq(size), np.fft.rfftfreq(size))
    )
    blur = np.outer(row, column).astype(np.float32)
    return np.stack([occupied, occupied * blur - free])


def _grids(
    scan: PreparedScan, angles: FloatArray, settings: MatchingSettings
) -> NDArray[np.float32]:
    """(2, A, G, G) 1 where there is a point, and where the scanner looked through the cell.

    In frames whose x axes have the directions `angles` (A,), centred on cell 0: negative cells
    wrap round.
    """
    size = grid_size(settings)
    grids = np.zeros((2, len(angles), size, size), dtype=np.float32)
    points = scan.points[np.hypot(*scan.points.T) < settings.correlation_radius_m]
    metres, bearing = _polar_cells(size, settings.correlation_cell_m)
    sectors = len(scan.free_ranges) / (2.0 * math.pi)
    reach = np.minimum(
        scan.free_ranges - settings.free_space_margin_m,
        _FREE_REACH * settings.correlation_radius_m,
    ).astype(np.float32)
    for occupied, free, angle in zip(*grids, angles, strict=True):
        cells = np.rint(points @ rotation_matrix(angle) / settings.correlation_cell_m).astype(int)
        occupied[cells[:, 1], cells[:, 0]] = 1.0
        first = np.float32(np.remainder(angle, 2.0 * math.pi) * sectors)
        sector = (bearing * np.float32(sectors) + first).astype(np.int32)
        np.less(metres, reach.take(sector, mode="wrap"), out=free)
    return grids


@lru_cache(maxsize=2)
def _polar_cells(size: int, cell_m: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(G, G) metres of the cells from cell 0, about which the grid wraps round, and bearings from 0 to 2 pi."""
    steps = np.fft.fftfreq(size, 1.0 / size) * cell_m
    x, y = np.meshgrid(steps, steps)
    bearing = np.arctan2(y, x) + math.pi
    return np.hypot(x, y).astype(np.float32), bearing.astype(np.float32)
