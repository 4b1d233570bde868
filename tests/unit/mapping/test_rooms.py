"""Rooms, walls and doors of made-up and of simulated floors, against the truth that made them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shapely import Polygon

from slam_uwb.mapping import build_floor_map, build_floor_plan, find_walls
from slam_uwb.mapping.rooms import door_gaps, find_rooms
from slam_uwb.model.floor import FloorMap
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import WallPieces
from slam_uwb.model.settings import MappingSettings, Settings
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate import simulate_survey

SETTINGS = MappingSettings()


def pieces(*rows, probability=0.95):
    """Rows (line, x1, y1, x2, y2), the room on the left."""
    table = np.array(rows, dtype=float)
    return WallPieces(
        table[:, 1:].reshape(-1, 2, 2),
        table[:, 0].astype(np.int32),
        np.full(len(table), probability),
    )


# Two rooms of 4 x 3 and 2 x 3 m on either side of a wall 0.2 m thick with a door of 1 m at y from 1 to 2.
TWO = pieces(
    (0, 0, 0, 4, 0), (1, 4, 0, 4, 1), (1, 4, 2, 4, 3), (2, 4, 3, 0, 3), (3, 0, 3, 0, 0),
    (4, 4.2, 0, 6.2, 0), (5, 6.2, 0, 6.2, 3), (6, 6.2, 3, 4.2, 3), (7, 4.2, 3, 4.2, 2), (7, 4.2, 1, 4.2, 0),
)  # fmt: skip
FREE = FloorMap(np.full((90, 160), 0.05), 0.05, (-0.6, -0.6))


def turned(walls, pose):
    return replace(walls, ends=pose.transform(walls.ends.reshape(-1, 2)).reshape(-1, 2, 2))


def test_two_rooms_and_the_door_between_them():
    plan = build_floor_plan(TWO, FREE, SETTINGS)
    assert [room.area for room in plan.rooms] == pytest.approx([12.0, 6.0])
    large = plan.rooms[0].polygon
    assert {tuple(np.round(corner, 6)) for corner in large} == {(0, 0), (4, 0), (4, 3), (0, 3)}
    assert Polygon(large).exterior.is_ccw
    (door,) = plan.doors
    # From jamb to jamb in the middle of the wall.
    assert sorted(map(tuple, np.round(door, 6))) == [(4.1, 1.0), (4.1, 2.0)]
    thick = [wall for wall in plan.walls if math.isfinite(wall.thickness)]
    assert [wall.thickness for wall in thick] == pytest.approx([0.2, 0.2])
    assert sorted(float(np.linalg.norm(w.ends[1] - w.ends[0])) for w in thick) == pytest.approx(
        [1, 1]
    )
    assert {round(float(w.ends[:, 0].mean()), 6) for w in thick} == {4.1}
    # What is left of the faces has no thickness: three sides of each room.
    assert len(plan.walls) - len(thick) == 6


@pytest.mark.parametrize("angle", [0.3, 1.1, 2.9])
def test_rooms_turn_with_the_frame(angle):
    pose = Pose2(0.2, 0.3, angle)
    everywhere = FloorMap(np.full((300, 300), 0.05), 0.1, (-15.0, -15.0))
    rooms = find_rooms(turned(TWO, pose), everywhere, SETTINGS)
    assert [room.area for room in rooms] == pytest.approx([12.0, 6.0])


def test_a_room_that_does_not_close_is_none():
    """Without its left wall the large room is open to the outside; the small one stays."""
    open_left = WallPieces(
        np.delete(TWO.ends, 4, axis=0), np.delete(TWO.line, 4), np.delete(TWO.probability, 4)
    )
    assert [room.area for room in find_rooms(open_left, FREE, SETTINGS)] == pytest.approx([6.0])


def test_an_opening_wider_than_a_door_joins_rooms():
    """2.2 m of 3 m open: both rooms and what is between them are one."""
    ends = TWO.ends.copy()
    ends[1] = [[4, 0], [4, 0.4]]
    ends[2] = [[4, 2.6], [4, 3]]
    ends[8], ends[9] = [[4.2, 3], [4.2, 2.6]], [[4.2, 0.4], [4.2, 0]]
    more = pieces((8, 4, 0.4, 4.2, 0.4), (9, 4.2, 2.6, 4, 2.6))
    joined = WallPieces(
        np.concatenate([ends, more.ends]), np.concatenate([TWO.line, more.line]),
        np.concatenate([TWO.probability, more.probability]),
    )  # fmt: skip
    (room,) = find_rooms(joined, FREE, SETTINGS)
    assert room.area == pytest.approx(12.0 + 6.0 + 0.2 * 2.2)


def test_furniture_bounds_no_room():
    """A cupboard's front along the left wall, too unlikely to be a wall."""
    front = pieces((10, 0.5, 3, 0.5, 0), probability=0.2)
    both = WallPieces(
        np.concatenate([TWO.ends, front.ends]), np.concatenate([TWO.line, front.line]),
        np.concatenate([TWO.probability, front.probability]),
    )  # fmt: skip
    assert find_rooms(both, FREE, SETTINGS)[0].area == pytest.approx(12.0)


def test_a_space_that_nobody_saw_is_no_room():
    unseen = np.full((90, 160), np.nan)
    unseen[:, 90:] = 0.05
    assert [
        r.area for r in find_rooms(TWO, replace(FREE, occupancy=unseen), SETTINGS)
    ] == pytest.approx([6.0])


def test_two_lines_of_one_face_leave_no_spike():
    """The lower wall of the large room as two lines 2 cm apart that overlap."""
    doubled = pieces((11, 0, 0.02, 3, 0.02))
    both = WallPieces(
        np.concatenate([TWO.ends, doubled.ends]), np.concatenate([TWO.line, doubled.line]),
        np.concatenate([TWO.probability, doubled.probability]),
    )  # fmt: skip
    room = find_rooms(both, FREE, SETTINGS)[0]
    assert room.area == pytest.approx(12.0, abs=0.1)
    assert len(room.polygon) <= 6


def test_gaps_wider_than_a_door_are_none():
    line, ends = (
        np.array([0, 0, 0]),
        np.array([[[0, 0], [1, 0]], [[1.9, 0], [3, 0]], [[6, 0], [7, 0]]], float),
    )
    np.testing.assert_allclose(door_gaps(line, ends, 1.6), [[[1, 0], [1.9, 0]]])
    # Whatever the order of the pieces.
    np.testing.assert_allclose(door_gaps(line, ends[::-1], 1.6), [[[1, 0], [1.9, 0]]])


def test_nothing_seen_has_an_empty_plan():
    nothing = WallPieces(np.empty((0, 2, 2)), np.empty(0), np.empty(0))
    plan = build_floor_plan(nothing, FREE, SETTINGS)
    assert (plan.rooms, plan.walls, len(plan.doors)) == ((), (), 0)


def sides(polygon):
    return np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)


@pytest.mark.parametrize(
    ("scene", "seed"), [("paper-office", 20), ("paper-office", 21), ("flat", 20)]
)
@pytest.mark.parametrize("upper", [True, False])
def test_rooms_of_a_simulated_floor(scene, seed, upper):
    """At the true poses: every room and no other, walls within 3 cm, areas within 3 %."""
    made = simulate_survey(scene, seed)
    settings = Settings()
    stations = made.survey.stations
    scans = {s.id: prepare_scan(s.id, s.scan, settings.scan) for s in stations}
    raised = {
        s.id: prepare_scan(s.id, s.upper_scan, settings.scan)
        for s in stations
        if s.upper_scan and upper
    }
    poses = {name: Pose2(p.x, p.y, p.theta) for name, p in made.reference.stations.items()}
    found = find_rooms(
        find_walls(scans, poses, settings.mapping, raised),
        build_floor_map(scans, poses, settings.mapping),
        settings.mapping,
    )
    assert len(found) == len(made.scene.rooms)
    for truth in made.scene.rooms:
        wanted = Polygon(truth)
        room = max(found, key=lambda r: Polygon(r.polygon).intersection(wanted).area)
        assert room.area == pytest.approx(wanted.area, rel=0.03)
        if len(room.polygon) == len(truth):
            first = int(np.argmin(np.linalg.norm(truth - room.polygon[0], axis=1)))
            assert np.abs(sides(room.polygon) - sides(np.roll(truth, -first, axis=0))).max() < 0.03
        else:
            # A flue or a pillar that the plan's room does not have.
            assert Polygon(room.polygon).symmetric_difference(wanted).area < 0.3
