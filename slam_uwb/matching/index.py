"""What matching needs of one scan, computed once: nearest points by table, free space, wall-aligned spectra."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points, rotation_matrix
from ..model.products import PreparedScan
from ..model.settings import MatchingSettings

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_TABLE_CELL_M = 0.1
_TABLE_MARGIN_M = 1.0
_TABLE_REACH_M = 30.0  # walls further away are not matched; bounds the table
# Oblique to the walls: along a wall that runs between two rows of cells each row would keep the
# points on its own side, and partners follow the noise of the point that looks for them.
_TABLE_TURN = 0.5
_NEAR_M = 0.5  # partners lie closer than this
DIRECTIONS = 360
"""Bins of the histogram of wall directions."""
BLOCK = 3
"""Cells along an edge of the blocks of the correlation grid that may hold one peak each."""
# Normals less certain than this mislead more than they help (library facts, 7).
_MAX_SLOPE_VARIANCE = 0.01


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


@dataclass(frozen=True, slots=True, eq=False)
class ScanIndex:
    """A prepared scan with its look-up structures.

    Looked up is in table axes, which turn with the walls: what is found does not depend on which
    way the scanner was turned.
    """

    scan: PreparedScan
    reach: float
    """m to the furthest point."""
    reliable: NDArray[np.bool_]
    """(N,) points whose normal can be trusted."""
    turn: float
    """rad, direction of the walls in the scanner's frame, that of the four in which most of them lie."""
    table_turn: float
    """rad, direction of the table's x axis in the scanner's frame."""
    columns: FloatArray
    """(4, N) x, y of the points and x, y of their normals, in the scanner's frame."""
    table_columns: FloatArray
    """(4, N) the same in table axes."""
    table: NDArray[np.int32]
    """(H, W) index of the point nearest to each cell's centre, in table axes."""
    table_origin: tuple[float, float]
    tree: cKDTree
    spectra: Spectra

    def nearest_in_table(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """Index (...,) of the point nearest to (x, y) (...,) in table axes; cells of 0.1 m, so nearly."""
        height, width = self.table.shape
        column = _cells(x, self.table_origin[0], width)
        row = _cells(y, self.table_origin[1], height)
        row *= width
        row += column
        return np.asarray(self.table.ravel().take(row))

    def nearest_by_search(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """The same by search: three times the time, and independent of how the cells lie."""
        return np.asarray(self.tree.query(np.stack([x, y], axis=-1))[1], dtype=np.int32)

    def free_range(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(...,) metres the scanner looked through towards the places (x, y) in table axes; 0 = unknown."""
        count = len(self.scan.free_ranges)
        sector = (np.arctan2(y, x) + (self.table_turn + math.pi)) * (count / (2.0 * math.pi))
        return self.scan.free_ranges.take(np.floor(sector).astype(np.int32) % count)


def _cells(coordinate: FloatArray, origin: float, count: int) -> NDArray[np.int32]:
    """(...,) number of the cell of each coordinate, the first or the last where it lies outside."""
    cells = coordinate - origin
    cells *= 1.0 / _TABLE_CELL_M
    np.maximum(cells, 0.0, out=cells)
    np.minimum(cells, count - 1.0, out=cells)
    return cells.astype(np.int32)


Distance = TypeVar("Distance", float, FloatArray)


def within_sight(one: ScanIndex, other: ScanIndex, metres: Distance) -> bool | NDArray[np.bool_]:
    """Whether two stations `metres` apart can see a wall in common."""
    return metres <= one.reach + other.reach + _NEAR_M


def index_scan(scan: PreparedScan, settings: MatchingSettings) -> ScanIndex:
    """Build the look-up structures of one scan; it must have at least one point."""
    from scipy.spatial import cKDTree

    turn = aligning_turn(scan)
    columns = np.concatenate([scan.points, scan.normals], axis=1)
    turned = columns.reshape(-1, 2) @ rotation_matrix(turn + _TABLE_TURN)
    table_columns = np.ascontiguousarray(turned.reshape(-1, 4).T)
    table, origin = _nearest_table(table_columns[:2].T)
    return ScanIndex(
        scan=scan,
        reach=float(np.hypot(*scan.points.T).max()),
        reliable=scan.normal_variance <= _MAX_SLOPE_VARIANCE,
        turn=turn,
        table_turn=turn + _TABLE_TURN,
        columns=np.ascontiguousarray(columns.T),
        table_columns=table_columns,
        table=table,
        table_origin=origin,
        tree=cKDTree(table_columns[:2].T),
        spectra=_spectra(scan, turn, settings),
    )


def _nearest_table(points: Points) -> tuple[NDArray[np.int32], tuple[float, float]]:
    from scipy.ndimage import distance_transform_edt

    reach = np.clip(points, -_TABLE_REACH_M, _TABLE_REACH_M)
    # The outermost point in the middle of its cell: on the edge, rounding would choose the cell.
    low = reach.min(axis=0) - _TABLE_MARGIN_M - 0.5 * _TABLE_CELL_M
    shape = np.ceil((reach.max(axis=0) + _TABLE_MARGIN_M - low) / _TABLE_CELL_M).astype(int)
    column, row = ((reach - low) / _TABLE_CELL_M).astype(int).T
    owner = np.full((shape[1], shape[0]), -1, dtype=np.int32)
    # Of several points in a cell the one next to its centre, whatever their order.
    off = np.hypot(*((reach - low) / _TABLE_CELL_M - np.column_stack([column, row]) - 0.5).T)
    order = np.argsort(-off, kind="stable")
    owner[row[order], column[order]] = order
    rows, columns = distance_transform_edt(owner < 0, return_distances=False, return_indices=True)
    return owner[rows, columns], (float(low[0]), float(low[1]))


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
    certain = scan.normal_variance <= _MAX_SLOPE_VARIANCE
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


def grid_size(settings: MatchingSettings) -> int:
    """Cells along an edge of the correlation grid; wraps round at twice the radius, which scoring sorts out.

    A whole number of blocks of cells that has small prime factors.
    """
    from scipy.fft import next_fast_len

    blocks = math.ceil(2.0 * settings.correlation_radius_m / settings.correlation_cell_m / BLOCK)
    return BLOCK * int(next_fast_len(blocks, real=True))


def _spectra(scan: PreparedScan, angle: float, settings: MatchingSettings) -> Spectra:
    from scipy.fft import rfft2

    grids = correlation_grids(scan, angle, settings)
    # Turning by 90 degrees maps cell (row, column) to (column, -row); half turns are conjugate
    # spectra.
    turned = np.roll(np.flip(grids.transpose(0, 2, 1), axis=2), 1, axis=2)
    spectra = rfft2(np.stack([grids, turned], axis=1))
    return Spectra(spectra[0], spectra[1], _direction_spectrum(scan, angle))


def _direction_spectrum(scan: PreparedScan, angle: float) -> NDArray[np.complex128]:
    certain = scan.normal_variance <= _MAX_SLOPE_VARIANCE
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
