from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from slam_uwb.model.geometry import rotation_matrix
from slam_uwb.simulate.placing import anchor_on_wall
from slam_uwb.simulate.plan import OUTER, Room, Wall, build_plan
from slam_uwb.simulate.polygon_plan import build_polygon_plan
from slam_uwb.simulate.radio import walls_crossed
from slam_uwb.simulate.segments import cast_rays

# Two rooms of 4 x 3 m side by side, a door of 1 m in the middle of the wall b-e between them.
CORNERS = {
    name: np.array(place, float)
    for name, place in {"a": (0, 0), "b": (4, 0), "c": (8, 0), "d": (8, 3), "e": (4, 3), "f": (0, 3)}.items()
}  # fmt: skip
LOOPS = ("a-b-e-f", "b-c-d-e")
DOORS = {"b-e": (0.5, 1.0)}
INNER = 0.1
BEARINGS = np.linspace(-np.pi, np.pi, 1441)


def turned(angle, corners=CORNERS):
    return {name: rotation_matrix(angle) @ place for name, place in corners.items()}


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=-1)


@pytest.fixture
def plan():
    return build_polygon_plan(CORNERS, LOOPS, DOORS, INNER)


def test_upright_rooms_are_those_of_the_upright_plan(plan):
    # Outer walls reach from 0.05 m inside the corners to 0.30 m further out: centre lines 0.10 m outside.
    back = (OUTER - INNER) / 2
    ring = [(-back, -back), (8 + back, -back), (8 + back, 3 + back), (-back, 3 + back)]
    walls = [Wall(ring[a], ring[b], OUTER) for a, b in ((0, 1), (3, 2), (0, 3), (1, 2))]
    walls.append(Wall((4, 0), (4, 3), INNER, ((1.5, 1.0),)))
    upright = build_plan(walls, [])
    for place in np.array([[1.0, 1.0], [3.9, 1.5], [6.0, 2.5], [-5.0, 4.0], [4.0, -3.0]]):
        for faces, others in (
            (plan.faces, upright.faces),
            (np.concatenate([plan.faces, plan.lintels]), np.concatenate([upright.faces, upright.lintels])),
        ):  # fmt: skip
            np.testing.assert_allclose(
                cast_rays(place, BEARINGS, faces), cast_rays(place, BEARINGS, others), atol=1e-9
            )
    assert lengths(plan.faces).sum() == pytest.approx(lengths(upright.faces).sum())
    np.testing.assert_allclose(plan.doors, upright.doors)


@pytest.mark.parametrize("angle", [0.3, 2.0, -1.2])
def test_a_turned_building_looks_the_same(plan, angle):
    other = build_polygon_plan(turned(angle), LOOPS, DOORS, INNER)
    for place in np.array([[1.0, 0.9], [6.0, 2.5]]):
        seen = cast_rays(rotation_matrix(angle) @ place, BEARINGS + angle, other.faces)
        np.testing.assert_allclose(seen, cast_rays(place, BEARINGS, plan.faces), atol=1e-9)
    np.testing.assert_allclose(other.partitions, plan.partitions @ rotation_matrix(angle).T)
    np.testing.assert_allclose(other.lintels, plan.lintels @ rotation_matrix(angle).T)


def test_every_wall_is_one_to_the_radio(three_rooms):
    for angle in (0.0, 0.6):
        plan = build_polygon_plan(turned(angle), LOOPS, DOORS, INNER)
        scene = replace(three_rooms, partitions=plan.partitions)
        paths = np.array([
            [[1, 0.5], [7, 0.5]],  # through the wall between
            [[1, 1.5], [7, 1.5]],  # through its door
            [[1, 1.5], [3, 2.5]],  # within a room
            [[1, 1.5], [1, -5]],  # out
            [[-5, 0.4], [12, 0.6]],  # all three
        ]) @ rotation_matrix(angle).T  # fmt: skip
        assert walls_crossed(scene, paths[:, 0], paths[:, 1]).tolist() == [1, 0, 0, 1, 3]


def test_walls_at_any_angle_have_their_thickness():
    # A triangle and a trapezoid on a common oblique wall: the two faces of b-c are parallel, 0.2 m apart.
    corners = {"a": [0, 0], "b": [4, 0], "c": [1, 5], "d": [6, 1], "e": [5, 6]}
    plan = build_polygon_plan(
        {k: np.array(v, float) for k, v in corners.items()}, ["a-b-c", "b-d-e-c"], {}, 0.2
    )
    one, other = plan.rooms[0].face("b-c"), plan.rooms[1].face("c-b")
    np.testing.assert_allclose(one.along, -other.along)
    assert (other.start - one.start) @ one.inward == pytest.approx(-0.2)
    for room in plan.rooms:
        # A corner lies on both its sides, each half a wall in front of the centre line.
        for corner, (a, b) in zip(
            room.polygon, pairwise([*room.names, room.names[0]]), strict=True
        ):
            line = np.array(corners[b], float) - corners[a]
            beside = line[0] * (corner - corners[a])[1] - line[1] * (corner - corners[a])[0]
            assert beside / np.linalg.norm(line) == pytest.approx(0.1)
    # The outer walls' faces are 0.3 m apart, on the far side of a-b, too: from y = 0.1 down to -0.2.
    assert plan.faces[..., 1].min() == pytest.approx(-0.2)


def test_nothing_is_seen_through_mitred_corners_and_jambs():
    plan = build_polygon_plan(turned(0.7), LOOPS, DOORS, INNER)
    rng = np.random.default_rng(0)
    for place in rng.uniform([0.2, 0.2], [7.8, 2.8], (60, 2)) @ rotation_matrix(0.7).T:
        ends = plan.faces.reshape(-1, 2) - place
        assert np.isfinite(cast_rays(place, np.arctan2(ends[:, 1], ends[:, 0]), plan.faces)).all()


def test_a_niche_is_part_of_its_room_and_a_pillar_stands_in_it():
    corners = turned(0.4, CORNERS | {"n": np.array([5.0, -1.0]), "o": np.array([6.0, -1.0])} | {
        "p": np.array([5.0, 0.0]), "q": np.array([6.0, 0.0])})  # fmt: skip
    pillar = np.array([[2, 1], [2.4, 1], [2.4, 1.4], [2, 1.4]]) @ rotation_matrix(0.4).T
    plan = build_polygon_plan(
        corners, ["a-b-e-f", "b-p-n-o-q-c-d-e"], DOORS, INNER, pillars=[pillar]
    )
    down, right = np.array([0.4 - np.pi / 2, 0.4])
    place = rotation_matrix(0.4) @ [5.5, 1.0]
    # The niche's back is 2 m below less half a wall; the pillar's face 1 m right of (1, 1.2).
    assert cast_rays(place, np.array([down]), plan.faces)[0] == pytest.approx(1.95)
    place = rotation_matrix(0.4) @ [1.0, 1.2]
    assert cast_rays(place, np.array([right]), plan.faces)[0] == pytest.approx(1.0)
    assert (
        len(plan.partitions) == 6 + 6
    )  # seven sides without door, two pieces of b-e, three more at the niche


def test_shares_of_a_room_are_along_its_first_side(plan):
    turned_room = build_polygon_plan(turned(0.5), LOOPS, DOORS, INNER).rooms[0]
    assert turned_room.yaw == pytest.approx(0.5)
    # Faces at 0.05 to 3.95 by 0.05 to 2.95 m.
    for share, place in (((0, 0), (0.05, 0.05)), ((0.5, 1), (2, 2.95)), ((1, 0.5), (3.95, 1.5))):
        np.testing.assert_allclose(turned_room.at(*share), rotation_matrix(0.5) @ place)
    np.testing.assert_allclose(turned_room.middle, rotation_matrix(0.5) @ [2.0, 1.5])


def test_anchors_hang_on_oblique_walls_beside_the_door():
    plan = build_polygon_plan(turned(0.5), LOOPS, DOORS, INNER)
    for seed in range(20):
        place = anchor_on_wall(
            np.random.default_rng(seed), plan, plan.rooms[0], "b-e", 0.5, jitter=0.6
        )
        x, y = rotation_matrix(0.5).T @ place[:2]
        assert x == pytest.approx(3.95 - 0.06)
        assert 0.05 < y < 2.95
        assert abs(y - 1.5) >= 0.5


@pytest.mark.parametrize(
    ("doors", "why"),
    [
        ({"b-e": (0.9, 1.0)}, "does not fit"),
        ({"a-b": (0.5, 1.0)}, "from one room to another"),
        ({"a-e": (0.5, 1.0)}, "from one room to another"),
    ],
)
def test_doors_that_cannot_be_are_refused(doors, why):
    with pytest.raises(ValueError, match=why):
        build_polygon_plan(CORNERS, LOOPS, doors, INNER)


def test_unknown_sides_are_refused_by_name(plan):
    with pytest.raises(ValueError, match="a-e"):
        plan.rooms[0].face("a-e")
    with pytest.raises(ValueError, match="'a'"):
        Room(0, 0, 1, 1).face("a")
