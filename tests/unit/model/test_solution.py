"""The map's own geometry."""

import numpy as np
import pytest

from slam_uwb.model.solution import FloorMap


def test_corners_enclose_just_the_cells_that_were_seen():
    occupancy = np.full((4, 6), np.nan)
    occupancy[1, 2] = 0.1
    occupancy[2, 4] = 0.9
    # Cells of half a metre from (-1, 2) on: columns 2 to 4 end at x = 0 and 1.5, rows 1 to 2 at y = 2.5 and 3.5.
    corners = FloorMap(occupancy, 0.5, (-1.0, 2.0)).seen_corners
    assert corners.tolist() == [[0.0, 2.5], [1.5, 3.5]]


@pytest.mark.parametrize("shape", [(0, 0), (3, 3)])
def test_a_map_of_the_unknown_has_no_corners(shape):
    assert FloorMap(np.full(shape, np.nan), 0.05, (0.0, 0.0)).seen_corners.shape == (0, 2)


def test_cells_are_free_or_occupied_or_neither():
    floor = FloorMap(np.array([[0.1, 0.5, 0.9, np.nan]]), 0.05, (0.0, 0.0))
    assert floor.free.tolist() == [[True, False, False, False]]
    assert floor.occupied.tolist() == [[False, False, True, False]]
