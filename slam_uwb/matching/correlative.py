"""Initial matches by correlation of hits and free space, both ways, in wall-aligned frames."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.settings import MatchingSettings
from .batch import first_of_each
from .index import ScanIndex
from .spectra import BLOCK, DIRECTIONS, Spectra, grid_size, turned_spectra

_DISTINCT_M = 0.3
_PEAK_BINS = 4  # degrees around a peak of the wall directions that belong to it
_PEAK_SHARE = 0.4  # of the highest peak that a further rotation must reach
_OBLIQUE = 4  # further rotations at most; each costs two transforms


def correlative_matches(
    target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> FloatArray:
    """Poses target_T_source (K, 3) at separated peaks of the correlation, the highest first.

    For each of the four rotations that bring the walls of both scans in line, the occupied cells of
    one scan are correlated with the blurred occupied minus the free cells of the other, and the
    other way round, for all translations at once (FFT; spectra are kept with the scans).
    """
    from scipy.fft import irfft2

    size = grid_size(settings)
    a, b = target.spectra, source.spectra
    turns = 0.5 * math.pi * np.arange(4)
    # Quarter turns 2 and 3 are those of 0 and 1 turned by 180 degrees: the conjugate of a real
    # grid's spectrum.
    oblique = _oblique_turns(a, b)
    spectra = np.empty((4 + len(oblique), *a.occupied.shape[1:]), dtype=np.complex64)
    _correlate(a, b.occupied.conj(), b.contrast.conj(), spectra[:2])
    _correlate(a, b.occupied, b.contrast, spectra[2:4])
    if len(oblique):
        occupied, contrast = turned_spectra(source.scan, source.turn - oblique, settings)
        turns = np.concatenate([turns, oblique])
        _correlate(a, occupied.conj(), contrast.conj(), spectra[4:])
    maps = np.asarray(irfft2(spectra, s=(size, size)), dtype=np.float32)
    turn, row, column = _peaks(maps, 4 * settings.initial_matches)
    signed = np.fft.fftfreq(size, 1.0 / size) * settings.correlation_cell_m
    shift = np.column_stack([signed[column], signed[row]])
    keep = _distinct(shift, turn, settings.initial_matches)
    c, s = math.cos(target.turn), math.sin(target.turn)
    x, y = shift[keep].T
    theta = target.turn - source.turn + turns[turn[keep]]
    return np.column_stack([c * x - s * y, s * x + c * y, theta])


def _correlate(
    target: Spectra,
    occupied: NDArray[np.complex64],
    contrast: NDArray[np.complex64],
    out: NDArray[np.complex64],
) -> None:
    """Write what each scan's free space says of the other's occupied cells, (A, G, G // 2 + 1)."""
    np.multiply(target.contrast[0], occupied, out=out)
    out += target.occupied[0] * contrast


def _oblique_turns(target: Spectra, source: Spectra) -> FloatArray:
    """Further rotations, rad beyond the wall-aligned one, that bring many walls of both scans in line.

    Peaks of the correlated histograms of wall directions. Where all walls stand at right angles
    these are the quarter turns, and there is nothing further.
    """
    from scipy.ndimage import maximum_filter1d

    agreement = np.fft.irfft(target.directions * source.directions.conj(), DIRECTIONS)
    highest = maximum_filter1d(agreement, 2 * _PEAK_BINS + 1, mode="wrap")
    peak = (agreement >= highest) & (agreement > _PEAK_SHARE * agreement.max())
    beyond = np.flatnonzero(peak) * (2.0 * math.pi / DIRECTIONS)
    quarter = 0.5 * math.pi
    off = np.abs(np.remainder(beyond + 0.5 * quarter, quarter) - 0.5 * quarter)
    oblique = off > math.radians(_PEAK_BINS)
    order = np.argsort(-agreement[np.flatnonzero(peak)][oblique], kind="stable")
    return np.asarray(beyond[oblique][order][:_OBLIQUE])


def _peaks(maps: NDArray[np.float32], count: int) -> tuple[NDArray[np.intp], ...]:
    """Turn, row and column of the highest cells, at most one a block of cells, the highest first.

    One peak a block, so that a ridge along a wall does not take all places.
    """
    turns, size, _ = maps.shape
    edge = size // BLOCK
    # Slice by slice: reducing an axis of three would take ten times as long.
    tallest = reduce(np.maximum, [maps[:, k::BLOCK] for k in range(BLOCK)])
    highest = reduce(np.maximum, [tallest[..., k::BLOCK] for k in range(BLOCK)]).ravel()
    best = np.argpartition(highest, -min(count, len(highest)))[-count:]
    best = best[np.lexsort((best, -highest[best]))]
    turn, row, column = np.unravel_index(best, (turns, edge, edge))
    blocks = maps.reshape(turns, edge, BLOCK, edge, BLOCK)
    inside = np.argmax(blocks[turn, row, :, column].reshape(len(best), -1), axis=1)
    return turn, row * BLOCK + inside // BLOCK, column * BLOCK + inside % BLOCK


def _distinct(shift: FloatArray, turn: NDArray[np.intp], count: int) -> list[int]:
    """Indices of up to `count` peaks, the highest first, none within 0.3 m of a higher one of the same turn."""
    x, y = shift.T[:, :, None] - shift.T[:, None, :]
    same = (turn[:, None] == turn) & (x * x + y * y < _DISTINCT_M**2)
    return first_of_each(np.arange(len(shift)), same, count)
