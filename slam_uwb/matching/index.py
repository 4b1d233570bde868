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
from .directions import aligning_turn, certain_normals
from .sight import Sight, coarse_sight
from .spectra import Spectra, scan_spectra

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_TABLE_CELL_M = 0.1
_TABLE_MARGIN_M = 1.0
_TABLE_REACH_M = 30.0  # walls further away are not matched; bounds the table
# Oblique to the walls: along a wall that runs between two rows of cells each row would keep the
# points on its own side, and partners follow the noise of the point that looks for them.
_TABLE_TURN = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ScanIndex:
    """A prepared scan with its look-up structures.

    Looked up is in table axes, which turn with the walls: what is found does not depend on which
    way the scanner was turned.
    """

    scan: PreparedScan
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
    sight: Sight

    @property
    def lengths(self) -> FloatArray:
        """(N,) m of wall that each point stands for."""
        return self.scan.lengths

    @property
    def on_wall(self) -> NDArray[np.bool_]:
        """(N,) whether the point lies on a wall."""
        return self.scan.on_wall

    def nearest_in_table(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """Index (...,) of the point nearest to (x, y) (...,) in table axes; cells of 0.1 m, so nearly."""
        height, width = self.table.shape
        left, bottom = self.table_origin
        return np.asarray(self.table.ravel().take(table_cells(x - left, y - bottom, width, height)))

    def nearest_by_search(self, x: FloatArray, y: FloatArray) -> NDArray[np.int32]:
        """The same by search: three times the time, and independent of how the cells lie."""
        return np.asarray(self.tree.query(np.stack([x, y], axis=-1))[1], dtype=np.int32)

    def free_range(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(...,) metres the scanner looked through towards the places (x, y) in table axes; 0 = unknown."""
        bearing = np.arctan2(y, x)
        return self.free_range_towards(bearing, out=np.empty_like(bearing))

    def free_range_towards(self, bearing: FloatArray, *, out: FloatArray) -> FloatArray:
        """The same towards bearings (...,), rad in table axes, which are overwritten; written to `out`."""
        sectors = len(self.scan.free_ranges) / (2.0 * math.pi)
        # A whole turn more than needed keeps the number positive, so that it may be cut off.
        bearing += math.remainder(self.table_turn, 2.0 * math.pi) + 3.0 * math.pi
        bearing *= sectors
        return self.scan.free_ranges.take(bearing.astype(np.int32), mode="wrap", out=out)


Count = TypeVar("Count", int, NDArray[np.int32])


def table_cells(x: FloatArray, y: FloatArray, width: Count, height: Count) -> NDArray[np.int32]:
    """(...,) cells, numbered row by row, of places (x, y) (...,) m from a table's corner.

    The outermost ones for places outside. The places are overwritten.
    """
    for coordinate, count in ((x, width), (y, height)):
        coordinate *= 1.0 / _TABLE_CELL_M
        np.maximum(coordinate, 0.0, out=coordinate)
        np.minimum(coordinate, count - 1.0, out=coordinate)
    cells = y.astype(np.int32)
    cells *= width
    cells += x.astype(np.int32)
    return cells


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
        reliable=certain_normals(scan),
        turn=turn,
        table_turn=turn + _TABLE_TURN,
        columns=np.ascontiguousarray(columns.T),
        table_columns=table_columns,
        table=table,
        table_origin=origin,
        tree=cKDTree(table_columns[:2].T),
        spectra=scan_spectra(scan, turn, settings),
        sight=coarse_sight(scan),
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
