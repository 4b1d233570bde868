"""What the building looks like: the map of the floor, its walls, doors and rooms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import FloatArray, Grid, Points, freeze_arrays

FREE_BELOW, OCCUPIED_ABOVE = 0.35, 0.65
"""What a cell's probability says; in between it is undecided."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorMap:
    """Occupancy grid in the world frame."""

    occupancy: Grid
    """(H, W) probability that the cell is occupied, 0-1; NaN = never seen. Row 0 at the smallest y."""
    resolution: float
    """m a cell."""
    origin: tuple[float, float]
    """m, world place of the lower left corner of cell (0, 0)."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) cells that were looked through."""
        return np.asarray(np.nan_to_num(self.occupancy, nan=1.0) < FREE_BELOW)

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(H, W) cells of walls and things."""
        return np.asarray(np.nan_to_num(self.occupancy, nan=0.0) > OCCUPIED_ABOVE)

    @property
    def seen_corners(self) -> Points:
        """(2, 2) m, lower left and upper right corner of what was seen; (0, 2) where nothing was."""
        rows, columns = np.nonzero(~np.isnan(self.occupancy))
        if not len(rows):
            return np.empty((0, 2))
        cells = np.array([(columns.min(), rows.min()), (columns.max() + 1, rows.max() + 1)])
        return np.asarray(np.array(self.origin) + cells * self.resolution)


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A closed room."""

    polygon: Points
    """(V, 2) m, between wall faces, counter-clockwise, world frame; a door is part of the wall it is in."""
    area: float
    """m^2."""

    def __post_init__(self) -> None:
        freeze_arrays(self, polygon=(None, 2))


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A straight wall or one face of it."""

    ends: FloatArray
    """(2, 2) m, world frame: of the centre line where both faces were seen, else of the face."""
    thickness: float
    """m; NaN where only one face was seen."""
    probability: float
    """0-1 that it is a wall and not furniture."""

    def __post_init__(self) -> None:
        freeze_arrays(self, ends=(2, 2))


@dataclass(frozen=True, slots=True, eq=False)
class FloorPlan:
    """Rooms, walls and doors."""

    rooms: tuple[Room, ...]
    """The largest first."""
    walls: tuple[Wall, ...]
    doors: FloatArray
    """(D, 2, 2) m, each from jamb to jamb, in the middle of the wall where both faces were seen."""

    def __post_init__(self) -> None:
        freeze_arrays(self, doors=(None, 2, 2))
