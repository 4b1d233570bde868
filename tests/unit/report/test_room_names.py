"""A room's name stands inside the room, clear of walls and of what else is drawn."""

import numpy as np
import pytest

from slam_uwb.report.room_names import roomiest_place

SQUARE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])


def test_an_empty_square_is_named_in_its_middle():
    assert roomiest_place(SQUARE, np.empty((0, 2))) == pytest.approx([2.0, 2.0], abs=0.1)


def test_what_stands_in_the_middle_is_avoided():
    """Above or below it rather than beside: text needs three times as much room to its sides."""
    place = roomiest_place(SQUARE, np.array([[2.0, 2.0]]))
    assert abs(place[1] - 2.0) > 0.5
    assert abs(place[1] - 2.0) < 1.5
    assert abs(place[0] - 2.0) < abs(place[1] - 2.0)


def test_a_room_round_a_corner_is_named_inside():
    """The mean of the corners of this L, (1.67, 1.67), lies outside it."""
    room = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0)])
    assert (room.mean(axis=0) > 1.0).all()
    for others in (np.empty((0, 2)), np.array([[2.5, 0.5]]), np.array([[0.5, 2.5], [0.5, 0.5]])):
        place = roomiest_place(room, others)
        assert (place > 0.0).all()
        assert (place < 4.0).all()
        assert place.min() < 1.0


def test_a_room_of_no_width_has_its_name_all_the_same():
    line = np.array([(0.0, 0.0), (4.0, 0.0), (2.0, 0.0)])
    assert roomiest_place(line, np.empty((0, 2))) == pytest.approx([2.0, 0.0])
