"""Walls of buildings drawn by hand and seen without noise, and what must hold for any building."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.mapping import find_walls
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MappingSettings
from slam_uwb.simulate import Lidar, simulate_survey
from slam_uwb.simulate.segments import crossing_fractions, distances_to_segments

SETTINGS = MappingSettings()


def crossed(walls, start, end):
    """Probabilities of the pieces that the straight path crosses, in the order of the path."""
    at = crossing_fractions(np.array([start], float), np.array([end], float), walls.ends)[0]
    order = np.argsort(at)
    return walls.probability[order[: np.isfinite(at).sum()]]


def lengths(walls):
    return np.linalg.norm(walls.ends[:, 1] - walls.ends[:, 0], axis=1)


def seen_at(walls, *points, within=0.08):
    """For each point the highest probability of the pieces there; 0 where there is none."""
    distances = distances_to_segments(np.array(points, float), walls.ends)
    return np.max(np.where(distances < within, walls.probability, 0.0), axis=1, initial=0.0)


@pytest.fixture(scope="module")
def two_rooms(outline):
    """5 x 4 m each, a wall of 0.12 m from x = 5 to 5.12 between them with a door from y = 1 to 1.9."""
    return outline((0, 0), (5, 0), (5, 1), (5.12, 1), (5.12, 0), (10.12, 0), (10.12, 4), (5.12, 4),
                   (5.12, 1.9), (5, 1.9), (5, 4), (0, 4))  # fmt: skip


@pytest.fixture(scope="module")
def rooms_seen(two_rooms, visit):
    return visit(two_rooms, (1.5, 1.2), (3.0, 2.6), (7.0, 1.6), (8.5, 2.9))


@pytest.fixture(scope="module")
def rooms(rooms_seen):
    return find_walls(*rooms_seen, SETTINGS)


def test_without_scans_there_are_no_walls(rooms_seen):
    scans, poses = rooms_seen
    for walls in (find_walls({}, {}, SETTINGS), find_walls(scans, {}, SETTINGS),
                  find_walls({}, poses, SETTINGS, upper_scans=scans)):  # fmt: skip
        assert walls.ends.shape == (0, 2, 2)
        assert len(walls.line) == len(walls.probability) == 0


def test_a_wall_blocks_and_a_door_does_not(rooms):
    faces = crossed(rooms, (2.0, 3.0), (8.0, 3.0))
    assert len(faces) == 2
    assert np.all(faces > 0.9)
    assert len(crossed(rooms, (2.0, 1.45), (8.0, 1.45))) == 0
    assert len(crossed(rooms, (1.0, 1.0), (4.5, 3.5))) == 0


def test_walls_end_where_the_door_begins(rooms):
    face = np.all(np.abs(rooms.ends[:, :, 0] - 5.0) < 0.02, axis=1) & (rooms.probability > 0.9)
    # 4 m of wall less 0.9 m of door. Each of the ends is known to half the distance of the rays there, one
    # degree apart: 2 to 5 cm from 2 or 3 m, less where it is a corner.
    assert lengths(rooms)[face].sum() == pytest.approx(3.1, abs=0.06)
    edges = np.sort(rooms.ends[face][:, :, 1].ravel())
    assert np.min(np.abs(edges - 1.0)) < 0.05
    assert np.min(np.abs(edges - 1.9)) < 0.05


def test_the_room_lies_on_the_left_of_each_face(rooms):
    along = rooms.ends[:, 1] - rooms.ends[:, 0]
    left = along[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(along, axis=1, keepdims=True)
    middles = rooms.ends.mean(axis=1)
    walls = (lengths(rooms) > 0.5) & (rooms.probability > 0.9)
    centre = np.where(middles[:, :1] < 5.06, [[2.5, 2.0]], [[7.62, 2.0]])
    assert walls.sum() >= 8
    assert np.all(np.einsum("ij,ij->i", left, centre - middles)[walls] > 0.0)


def test_two_scans_of_one_wall_give_one_line(rooms):
    # Faces of two rooms: y = 0 and y = 4 are common to both, the others are their own: 2 + 4, and two jambs.
    assert len(np.unique(rooms.line[rooms.probability > 0.9])) == 6


@pytest.mark.parametrize("move", [Pose2(3.0, -7.0, 0.0), Pose2(-40.0, 12.0, 2.1)])
def test_moving_the_frame_moves_the_walls(rooms_seen, rooms, move):
    scans, poses = rooms_seen
    moved = find_walls(scans, {name: move @ pose for name, pose in poses.items()}, SETTINGS)
    order, there = (
        np.lexsort(np.round(ends.mean(axis=1), 3).T)
        for ends in (
            rooms.ends,
            move.inverse().transform(moved.ends.reshape(-1, 2)).reshape(-1, 2, 2),
        )
    )
    back = move.inverse().transform(moved.ends.reshape(-1, 2)).reshape(-1, 2, 2)
    np.testing.assert_allclose(back[there], rooms.ends[order], atol=1e-6)
    np.testing.assert_allclose(moved.probability[there], rooms.probability[order], atol=1e-6)


def test_the_order_of_stations_does_not_matter(rooms_seen, rooms):
    scans, poses = rooms_seen
    again = find_walls(
        dict(reversed(scans.items())), dict(sorted(poses.items(), reverse=True)), SETTINGS
    )
    np.testing.assert_array_equal(again.ends, rooms.ends)
    np.testing.assert_array_equal(again.line, rooms.line)
    np.testing.assert_array_equal(again.probability, rooms.probability)


def test_free_standing_furniture_is_hardly_a_wall(outline, visit):
    table = outline((3.4, 2.2), (4.6, 2.2), (4.6, 2.9), (3.4, 2.9))
    faces = np.concatenate([outline((0, 0), (8, 0), (8, 5), (0, 5)), table])
    walls = find_walls(*visit(faces, (1.5, 2.5), (6.5, 2.4), (4.0, 0.8), (4.0, 4.2)), SETTINGS)
    assert np.all(crossed(walls, (1.5, 2.5), (6.5, 2.5)) < 0.2)
    assert np.all(seen_at(walls, (4, 0), (4, 5), (0, 2.5), (8, 2.5)) > 0.9)


def test_a_row_of_cupboards_is_no_wall_and_hides_none(outline, visit):
    # 4.4 m of cupboards before the upper wall, which is seen to the left and to the right of them.
    faces = outline((0, 0), (8, 0), (8, 5), (5.5, 5), (5.5, 4.5), (3.5, 4.5), (3.5, 5), (0, 5))
    walls = find_walls(*visit(faces, (1.5, 2.0), (4.5, 1.5), (6.5, 2.0)), SETTINGS)
    assert seen_at(walls, (4.5, 4.5)) < 0.3
    assert seen_at(walls, (4.5, 5.0)) > 0.9


def test_a_corner_behind_furniture_is_closed(outline, visit):
    # A cupboard 1 m wide and 0.9 m deep fills the corner at (8, 5).
    faces = outline((0, 0), (8, 0), (8, 4.1), (7, 4.1), (7, 5), (0, 5))
    walls = find_walls(*visit(faces, (2.0, 2.0), (4.5, 1.5), (6.5, 2.0)), SETTINGS)
    assert np.all(seen_at(walls, (7.5, 5.0), (7.9, 5.0), (8.0, 4.5), (8.0, 4.9)) > 0.9)


def test_a_gap_that_was_looked_through_stays_open_beside_a_hidden_one(outline, visit):
    # In the upper wall a niche 2 m wide and deep, seen into, and a cupboard 2 m wide, seen as such.
    faces = outline((0, 0), (12, 0), (12, 5), (10.5, 5), (10.5, 4.4), (8.5, 4.4), (8.5, 5), (4, 5), (4, 7),
                    (2, 7), (2, 5), (0, 5))  # fmt: skip
    walls = find_walls(*visit(faces, (2.5, 2.0), (4.5, 1.5), (9.5, 2.0), (11, 3)), SETTINGS)
    assert seen_at(walls, (3.0, 5.0)) == 0.0
    assert seen_at(walls, (9.5, 5.0)) > 0.9


def test_a_stub_of_wall_is_told_from_a_screen(outline, visit):
    # Both 0.9 m long and 0.12 m thick; the one stands against the lower wall, the other free.
    stub = (3.0, 0), (3.0, 0.9), (3.12, 0.9), (3.12, 0)
    screen = outline((6.0, 2.0), (6.12, 2.0), (6.12, 2.9), (6.0, 2.9))
    faces = np.concatenate([outline((0, 0), *stub, (9, 0), (9, 5), (0, 5)), screen])
    walls = find_walls(*visit(faces, (1.2, 1.2), (4.6, 1.5), (7.8, 2.0)), SETTINGS)
    assert np.all(seen_at(walls, (3.0, 0.5), (3.12, 0.5)) > 0.6)
    assert seen_at(walls, (6.06, 2.45)) < 0.2


def test_a_round_wall_is_a_wall(visit):
    angles = np.linspace(0.0, 2.0 * math.pi, 181)
    ring = 4.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    faces = np.stack([ring[:-1], ring[1:]], axis=1)
    walls = find_walls(*visit(faces, (1.0, 0.5), (-1.5, 0.2)), SETTINGS)
    for turn in np.radians([10.0, 100.0, 190.0, 280.0]):
        out = 6.0 * np.array([math.cos(turn), math.sin(turn)])
        assert np.max(crossed(walls, (0.0, 0.0), out), initial=0.0) > 0.5
    # Straight pieces of up to 2 m leave a circle of 4 m by 0.12 m; none runs on along its tangent.
    assert np.linalg.norm(walls.ends, axis=2).max() < 4.4


def test_a_slanting_segment_through_a_wall_makes_no_second_wall(rooms_seen, rooms):
    # A bad fit, 10 degrees off, to points of the wall y = 0, on which all of them lie.
    scans, poses = rooms_seen
    bad = poses["s0"].inverse().transform([[1.0, -0.14], [2.6, 0.142]])
    segments = np.concatenate([scans["s0"].segments, bad[None]])
    walls = find_walls({**scans, "s0": replace(scans["s0"], segments=segments)}, poses, SETTINGS)
    assert lengths(walls).sum() == pytest.approx(lengths(rooms).sum(), abs=0.05)


@pytest.fixture(scope="module")
def raised_rooms(two_rooms, outline, visit, look):
    """A wardrobe 3 m long, free-standing; the raised scans see over it, and the door closed by its lintel."""
    wardrobe = outline((1.2, 1.8), (4.2, 1.8), (4.2, 2.3), (1.2, 2.3))
    low = np.concatenate([two_rooms, wardrobe])
    lintels = np.array([[[5, 1], [5, 1.9]], [[5.12, 1], [5.12, 1.9]]])
    scans, poses = visit(low, (2.5, 1.0), (2.5, 3.2), (7.0, 1.6), (8.5, 2.9))
    turned = {name: Pose2(p.x, p.y, p.theta + 1.0) for name, p in poses.items()}
    high = np.concatenate([two_rooms, lintels])
    return scans, poses, {name: look(high, pose) for name, pose in turned.items()}


def test_raised_scans_tell_furniture_from_walls_and_close_no_door(raised_rooms):
    scans, poses, raised = raised_rooms
    low = find_walls(scans, poses, SETTINGS)
    both = find_walls(scans, poses, SETTINGS, upper_scans=raised)
    assert np.max(crossed(low, (2.5, 1.0), (2.5, 3.2))) > 0.8
    assert np.max(crossed(both, (2.5, 1.0), (2.5, 3.2))) < 0.1
    assert len(crossed(both, (4.6, 1.45), (8.0, 1.45))) == 0
    assert np.all(crossed(both, (4.5, 3.0), (8.0, 3.0)) > 0.9)


def test_an_upper_scan_without_a_station_is_left_out(raised_rooms):
    scans, poses, raised = raised_rooms
    stray = {"elsewhere": raised["s0"]}
    np.testing.assert_array_equal(
        find_walls(scans, poses, SETTINGS, upper_scans=stray).ends,
        find_walls(scans, poses, SETTINGS).ends,
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_with_noise_whatever_counts_as_wall_is_one(seed, prepare_survey):
    simulation = simulate_survey(
        "paper-office", seed, lidar=Lidar(duration=6.0, upper_duration=0.0)
    )
    rng = np.random.default_rng(seed)
    scans, poses = prepare_survey(simulation, sigma=0.015, sigma_theta=math.radians(0.3), rng=rng)
    walls = find_walls(scans, poses, SETTINGS)
    likely = walls.probability > 0.5
    shares = np.linspace(0.1, 0.9, 9)[:, None, None]
    points = walls.ends[likely, 0] + shares * (walls.ends[likely, 1] - walls.ends[likely, 0])
    off = distances_to_segments(points.reshape(-1, 2), simulation.scene.walls).min(axis=1)
    weight = np.tile(lengths(walls)[likely], 9)
    assert weight[off > 0.12].sum() < 0.05 * weight.sum()


def test_a_large_floor_takes_a_second_at_most(prepare_survey):
    simulation = simulate_survey(
        "random-floor-30", 3, lidar=Lidar(duration=2.0, upper_duration=0.0)
    )
    scans, poses = prepare_survey(simulation)
    begin = time.perf_counter()
    walls = find_walls(scans, poses, SETTINGS)
    assert len(walls.line) > 200
    assert time.perf_counter() - begin < 3.0  # 0.15 s on an idle core
