"""A floor map for a terminal: two cells a character."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.floor import FloorMap
    from ..model.geometry import Vector2
from ..model.solution import Solution


def draw_text_map(
    solution: Solution, columns: int = 76, rows: int = 30, *, place: Vector2 | None = None
) -> list[str]:
    """Lines of at most `columns` by `rows` characters; no lines without a map.

    Walls are blocks, seen floor is a dot, stations are `o`, anchors `A`, `place` is `x`; y points up.
    """
    floor = solution.floor_map
    if floor is None or not floor.occupancy.size:
        return []
    height, width = floor.occupancy.shape
    # A character is about twice as high as wide.
    cells = max(1, -(-width // columns), -(-height // (2 * rows)))
    walls = _any(floor.occupied, 2 * cells, cells)
    seen = _any(floor.free, 2 * cells, cells)
    picture = np.where(walls, "█", np.where(seen, "·", " "))
    for station in solution.stations:
        if station.pose is not None:
            _mark(picture, floor, station.pose.translation, cells, "o")
    for anchor in solution.anchors:
        if anchor.position is not None:
            _mark(picture, floor, anchor.position, cells, "A")
    if place is not None:
        _mark(picture, floor, place, cells, "x")
    return ["".join(row).rstrip() for row in picture[::-1]]


def _any(cells: NDArray[np.bool_], high: int, wide: int) -> NDArray[np.bool_]:
    """Blocks of `high` by `wide` cells that hold any."""
    height, width = cells.shape
    padded = np.zeros((-(-height // high) * high, -(-width // wide) * wide), dtype=bool)
    padded[:height, :width] = cells
    blocks = padded.reshape(padded.shape[0] // high, high, padded.shape[1] // wide, wide)
    return np.asarray(blocks.any(axis=(1, 3)), dtype=bool)


def _mark(picture: NDArray[Any], floor: FloorMap, place: Vector2, cells: int, sign: str) -> None:
    cell = (place - np.array(floor.origin)) / floor.resolution // np.array([cells, 2 * cells])
    column, row = int(cell[0]), int(cell[1])
    if 0 <= row < picture.shape[0] and 0 <= column < picture.shape[1]:
        picture[row, column] = sign
