import numpy as np
import pytest

from slam_uwb.model.geometry import rotation_matrix
from slam_uwb.simulate.furniture import Piece, against, keep_clear, standing
from slam_uwb.simulate.plan import Room, Wall, build_plan
from slam_uwb.simulate.polygon_plan import build_polygon_plan

ROOM = Room(0.1, -3.0, 4.0, 3.0)
PLAN = build_plan([Wall((0, -3), (0, 3), 0.2, ((0.0, 1.0),))], [ROOM])
NOWHERE = np.empty((0, 2))
NO_SIGHTS = np.empty((0, 2, 2))
CUPBOARD = (1.0, 0.5, 1.8)


def kept(*groups, stations=NOWHERE, stands=NOWHERE, sights=NO_SIGHTS):
    return keep_clear(groups, PLAN, stations, stands, sights)


def test_a_piece_has_its_back_to_the_wall():
    north, east = against(ROOM, "n", 0.0, CUPBOARD), against(ROOM, "e", 1.0, CUPBOARD)
    # 3 cm off the wall and, at the ends, off the side walls.
    np.testing.assert_allclose(north.corners.min(axis=0), [0.13, 2.47])
    np.testing.assert_allclose(north.corners.max(axis=0), [1.13, 2.97])
    np.testing.assert_allclose(east.corners.min(axis=0), [3.47, 1.97])
    np.testing.assert_allclose(east.corners.max(axis=0), [3.97, 2.97])


@pytest.mark.parametrize("angle", [0.0, 0.6, 2.5, -1.9])
def test_a_piece_stands_along_a_wall_of_any_direction(angle):
    turn = rotation_matrix(angle)
    corners = {"a": (0, 0), "b": (4, 0), "c": (4, 3), "d": (0, 3)}
    plan = build_polygon_plan({k: turn @ v for k, v in corners.items()}, ["a-b-c-d"], {}, 0.2)
    piece = against(plan.rooms[0], "b-c", 1.0, CUPBOARD)
    # Inner faces at x = 3.9 and y = 2.9; 3 cm off both, 0.5 m deep and 1.0 m wide.
    local = piece.corners @ turn
    np.testing.assert_allclose(local.min(axis=0), [3.37, 1.87])
    np.testing.assert_allclose(local.max(axis=0), [3.87, 2.87])
    assert keep_clear([[piece]], plan, NOWHERE, NOWHERE, NO_SIGHTS) == [piece]
    free = standing(plan.rooms[0], 0.5, 0.5, 0.0, CUPBOARD)
    np.testing.assert_allclose((free.corners @ turn).min(axis=0), [1.5, 1.25])


def test_distance_to_a_piece_is_from_its_outside():
    turned = Piece(0.0, 0.0, np.pi / 2, 4.0, 2.0, 1.0)
    # 2 m along x, 4 m along y after a quarter turn.
    np.testing.assert_allclose(
        turned.distances(np.array([[0.5, 1.5], [2.0, 0.0], [0.0, 3.0], [4.0, 6.0]])), [0, 1, 1, 5]
    )


def test_undisturbed_furniture_stays():
    pieces = [against(ROOM, "n", 0.5, CUPBOARD), standing(ROOM, 0.6, 0.4, 0.1, CUPBOARD)]
    assert kept(pieces[:1], pieces[1:]) == pieces


@pytest.mark.parametrize(
    "scene",
    [
        {"stations": np.array([[2.0, 0.6]])},
        {"stands": np.array([[2.0, 0.4]])},
        {"sights": np.array([[[0.5, 0.0], [3.5, 0.0]]])},
    ],
    ids=lambda scene: next(iter(scene)),
)
def test_furniture_in_the_way_goes(scene):
    # Reaches from x = 1.5 to 2.5 and y = -0.25 to 0.25.
    piece = Piece(2.0, 0.0, 0.0, *CUPBOARD)
    assert kept([piece]) == [piece]
    assert kept([piece], **scene) == []


def test_low_furniture_may_stand_between_scanners():
    table = Piece(2.0, 0.0, 0.0, 1.0, 0.5, 0.75)
    assert kept([table], sights=np.array([[[0.5, 0.0], [3.5, 0.0]]])) == [table]


def test_furniture_neither_blocks_doors_nor_stands_in_walls_nor_in_other_furniture():
    first = Piece(2.0, 1.5, 0.0, *CUPBOARD)
    assert kept([Piece(0.9, 0.0, 0.0, *CUPBOARD)]) == []
    assert kept([Piece(0.2, 2.0, 0.0, *CUPBOARD)]) == []
    assert kept([first], [Piece(2.6, 1.6, 0.0, *CUPBOARD)]) == [first]
    assert kept([first], [Piece(2.0, 1.5, 0.0, 0.2, 0.2, 1.0)]) == [first]


def test_pieces_that_belong_together_go_together():
    group = [Piece(2.0, 1.5, 0.0, *CUPBOARD), Piece(2.0, -1.5, 0.0, *CUPBOARD)]
    assert kept(group) == group
    assert kept(group, stations=np.array([[2.0, -2.0]])) == []
