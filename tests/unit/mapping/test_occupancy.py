"""The occupancy grid: a room known by hand, exact traversal, invariance, order, limits."""

import math

import numpy as np
import pytest

from slam_uwb.mapping import build_floor_map
from slam_uwb.mapping.occupancy import cells_passed, wall_samples
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import PreparedScan
from slam_uwb.model.settings import MappingSettings

SETTINGS = MappingSettings(resolution_m=0.1, margin_m=0.3, hit_log_odds=2.0, free_log_odds=-1.0)
ONE_HIT, ONE_PASS = 1.0 / (1.0 + math.exp(-2.0)), 1.0 / (1.0 + math.exp(1.0))


def scan_of(points, normals=None, lengths=None):
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    return PreparedScan(
        station="s",
        points=points,
        normals=np.zeros_like(points) if normals is None else normals,
        normal_variance=np.zeros(len(points)),
        lengths=np.zeros(len(points)) if lengths is None else lengths,
        on_wall=np.ones(len(points), dtype=bool),
        segments=np.zeros((0, 2, 2)),
        landmarks=np.zeros((0, 2)),
        free_ranges=np.zeros(0),
        noise=0.0,
    )


def square_room(half=1.05, at=(0.0, 0.0), step_deg=1.0):
    """Scan, from `at`, of a square room with walls at +-half."""
    bearings = np.arange(-math.pi, math.pi - 1e-9, math.radians(step_deg)) + 1e-3
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
    to_walls = (half * np.sign(directions) - np.asarray(at)) / directions
    wall = np.argmin(to_walls, axis=1)
    points = directions * to_walls.min(axis=1)[:, None]
    normals = np.where(np.arange(2) == wall[:, None], -np.sign(directions), 0.0)
    gaps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return scan_of(points, normals, 0.5 * (gaps + np.roll(gaps, 1)))


def expected_room(ring, first, size):
    """Occupied ring of cells -ring-1 and ring (walls at +-(ring + 0.5) cells), free inside."""
    column, row = np.meshgrid(np.arange(size[0]) + first[0], np.arange(size[1]) + first[1])
    reach = np.maximum(np.maximum(column, -1 - column), np.maximum(row, -1 - row))
    return np.select([reach < ring, reach == ring], [ONE_PASS, ONE_HIT], np.nan)


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.31, -0.62)])
@pytest.mark.parametrize("half", [1.05, 6.05])
def test_square_room_known_by_hand(half, at):
    # Walls at 1.05 m, cells of 0.1 m: the walls lie in cells -11 and 10, 20 x 20 inside.
    # Walls at 6.05 m: points one degree apart are up to two cells apart there and leave no gap.
    floor_map = build_floor_map({"s": square_room(half, at)}, {"s": Pose2(*at, 0.0)}, SETTINGS)
    first = np.round(np.array(floor_map.origin) / 0.1).astype(int)
    expected = expected_room(round((half - 0.05) / 0.1), first, floor_map.occupancy.shape[::-1])
    # Which cells of the very corners are hit depends on where the beams next to them happen to end.
    column, row = np.meshgrid(
        *(np.arange(n) + k for n, k in zip(expected.shape[::-1], first, strict=True))
    )
    clear = np.minimum(np.maximum(column, -1 - column), np.maximum(row, -1 - row)) < (
        half / 0.1 - 3
    )
    np.testing.assert_allclose(floor_map.occupancy[clear], expected[clear], atol=1e-12)
    assert floor_map.resolution == 0.1
    # A border of at least three unknown cells all round.
    assert np.isnan(floor_map.occupancy[:3]).all()
    assert np.isnan(floor_map.occupancy[:, -3:]).all()


def test_evidence_adds_up_and_is_limited():
    # One beam along x: cells 0-4 passed, cell 5 hit; three scans: 3 * -1, and 3 * 2 cut to 5.
    scans = {name: scan_of([(0.5, 0.0)]) for name in "abc"}
    poses = {name: Pose2(0.05, 0.05, 0.0) for name in "abc"}
    floor_map = build_floor_map(scans, poses, SETTINGS)
    row = floor_map.occupancy[3]
    np.testing.assert_allclose(row[3:8], 1.0 / (1.0 + math.exp(3.0)))
    np.testing.assert_allclose(row[8], 1.0 / (1.0 + math.exp(-5.0)))
    assert np.isnan(floor_map.occupancy).sum() == floor_map.occupancy.size - 6


def test_a_scan_counts_a_cell_once_however_many_beams():
    # A hundred beams into one cell are one hit and one pass of each cell before it.
    fan = np.column_stack([np.full(100, 0.5), np.linspace(-0.04, 0.04, 100)])
    floor_map = build_floor_map({"s": scan_of(fan)}, {"s": Pose2(0.05, 0.05, 0.0)}, SETTINGS)
    values = floor_map.occupancy[3]
    np.testing.assert_allclose(values[3:9], [ONE_PASS] * 5 + [ONE_HIT])


def test_a_hit_cell_is_never_made_free_by_its_own_scan():
    # The second return lies behind the first: its beam passes the first one's cell.
    floor_map = build_floor_map(
        {"s": scan_of([(0.5, 0.0), (1.0, 0.0)])}, {"s": Pose2(0.05, 0.05, 0.0)}, SETTINGS
    )
    np.testing.assert_allclose(floor_map.occupancy[3, [8, 13]], ONE_HIT)
    # Another scan that looks through it does count: 2 - 1.
    both = build_floor_map(
        {"s": scan_of([(0.5, 0.0)]), "t": scan_of([(1.0, 0.0)])},
        {"s": Pose2(0.05, 0.05, 0.0), "t": Pose2(0.05, 0.05, 0.0)},
        SETTINGS,
    )
    np.testing.assert_allclose(both.occupancy[3, 8], 1.0 / (1.0 + math.exp(-1.0)))


def test_wall_ends_at_a_door():
    # Wall at y = 1 in steps of 0.2 m up to the jamb at x = 0, then the far wall. The jamb's
    # piece reaches half the regular gap beyond the point and no further.
    points = np.array([(-0.6, 1.0), (-0.4, 1.0), (-0.2, 1.0), (0.0, 1.0), (1.0, 5.0)])[::-1]
    normals = np.tile([0.0, -1.0], (5, 1))
    samples = wall_samples(scan_of(points, normals, np.full(5, 0.25)), spacing=0.05)
    near = samples[samples[:, 1] < 2.0]
    assert near[:, 0].max() == pytest.approx(0.1 - 0.2 / 4 / 2)
    assert near[:, 0].min() == pytest.approx(-0.7 + 0.2 / 4 / 2)
    assert np.diff(np.sort(near[:, 0])).max() <= 0.05 + 1e-12
    np.testing.assert_allclose(near[:, 1], 1.0)


def test_points_without_a_normal_stay_points():
    np.testing.assert_array_equal(
        wall_samples(scan_of([(1.0, 2.0), (1.1, 2.0)], lengths=np.array([0.2, 0.2])), 0.01),
        [(1.0, 2.0), (1.1, 2.0)],
    )


def test_cells_passed_are_exactly_those_the_line_touches():
    random = np.random.default_rng(3)
    start = random.uniform(-3, 3, 2)
    for end in random.uniform(-9, 9, (60, 2)):
        cells = cells_passed(start, end[None, :])
        found = {tuple(cell) for cell in cells}
        # Independent of the code under test: clip the line to every cell of the box (slab method).
        low, high = np.floor(np.minimum(start, end)), np.floor(np.maximum(start, end))
        grid = np.stack(
            np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)), axis=-1
        ).reshape(-1, 2)
        edges = (np.stack([grid, grid + 1]) - start) / (end - start)
        enters, leaves = edges.min(axis=0).max(axis=1), edges.max(axis=0).min(axis=1)
        touched = {
            tuple(cell) for cell in grid[np.maximum(enters, 0) < np.minimum(leaves, 1)].astype(int)
        }
        assert found == touched - {tuple(np.floor(end).astype(int))}
        assert len(cells) == len(found)


@pytest.mark.parametrize(
    "end", [(5.5, 0.5), (-4.5, 0.5), (0.5, 6.5), (0.5, -3.5), (4.5, 4.5), (0.7, 0.2)]
)
def test_lines_along_the_axes_and_the_diagonal(end):
    cells = cells_passed(np.array([0.5, 0.5]), np.array([end]))
    # From cell (0, 0): each cell of the way but the last, one after the other.
    assert len(np.unique(cells, axis=0)) >= int(np.max(np.abs(np.floor(end))))
    assert np.all(cells >= np.minimum(0, np.floor(end)))
    assert np.all(cells <= np.maximum(0, np.floor(end)))


def room_survey():
    at = {"a": (0.31, -0.62), "b": (-0.47, 0.13), "c": (0.02, 0.77)}
    headings = {"a": 0.0, "b": 1.0, "c": -2.5}
    poses = {name: Pose2(*place, headings[name]) for name, place in at.items()}
    scans = {}
    for name, place in at.items():
        seen = square_room(1.05, place)
        back = Pose2(0.0, 0.0, -headings[name])
        scans[name] = scan_of(
            back.transform(seen.points), back.transform(seen.normals), seen.lengths
        )
    return scans, poses


def test_order_of_the_scans_changes_nothing():
    scans, poses = room_survey()
    forward = build_floor_map(scans, poses, SETTINGS)
    backward = build_floor_map(
        dict(reversed(scans.items())), dict(reversed(poses.items())), SETTINGS
    )
    assert forward.occupancy.tobytes() == backward.occupancy.tobytes()
    assert forward.origin == backward.origin


def test_moving_by_whole_cells_moves_the_map():
    scans, poses = room_survey()
    here = build_floor_map(scans, poses, SETTINGS)
    # 12.8 and -7.2 m are cells of 0.1 m (up to rounding in floating point, which no wall is near).
    moved = {name: Pose2(12.8, -7.2, 0.0) @ pose for name, pose in poses.items()}
    there = build_floor_map(scans, moved, SETTINGS)
    np.testing.assert_array_equal(there.occupancy, here.occupancy)
    np.testing.assert_allclose(np.subtract(there.origin, here.origin), (12.8, -7.2), atol=1e-9)


def test_a_quarter_turn_turns_the_map():
    scans, poses = room_survey()
    here = build_floor_map(scans, poses, SETTINGS)
    turned = {name: Pose2(0.0, 0.0, math.pi / 2) @ pose for name, pose in poses.items()}
    there = build_floor_map(scans, turned, SETTINGS)
    # (x, y) -> (-y, x): column of the new map counts down the rows of the old one.
    trim = [grid[np.ix_(*[np.flatnonzero(~np.isnan(grid).all(axis=k)) for k in (1, 0)])]
            for grid in (here.occupancy, there.occupancy)]  # fmt: skip
    np.testing.assert_allclose(trim[1], trim[0].T[:, ::-1], equal_nan=True)


def test_any_turn_moves_walls_by_no_more_than_a_cell():
    scans, poses = room_survey()
    turn = Pose2(3.3, 1.7, 0.6)
    floor_map = build_floor_map(
        scans, {name: turn @ pose for name, pose in poses.items()}, SETTINGS
    )
    rows, columns = np.nonzero(floor_map.occupancy > 0.5)
    centres = np.column_stack([columns, rows]) * 0.1 + 0.05 + np.array(floor_map.origin)
    in_room = np.abs(turn.inverse().transform(centres)).max(axis=1)
    # A cell's centre is at most half its diagonal from the wall at 1.05 m.
    assert np.all(np.abs(in_room - 1.05) <= 0.1 * math.sqrt(0.5) + 1e-9)
    assert len(rows) >= 4 * 2.1 / 0.1 / math.sqrt(2.0)


def test_cells_stay_where_they_are_when_the_map_grows():
    scans, poses = room_survey()
    alone = build_floor_map({"a": scans["a"]}, poses, SETTINGS)
    wider = build_floor_map(
        {"a": scans["a"], "far": scan_of([(0.4, 0.0)])},
        poses | {"far": Pose2(-3.3, -2.2, 0.0)},
        SETTINGS,
    )
    for value in (*alone.origin, *wider.origin):
        assert value / 0.1 == pytest.approx(round(value / 0.1), abs=1e-9)
    column, row = np.round(np.subtract(alone.origin, wider.origin) / 0.1).astype(int)
    height, width = alone.occupancy.shape
    window = wider.occupancy[row : row + height, column : column + width]
    np.testing.assert_array_equal(window, alone.occupancy)


def test_scans_without_a_place_are_left_out():
    scans, poses = room_survey()
    some = build_floor_map(scans, {"a": poses["a"], "unscanned": Pose2(90.0, 0.0, 0.0)}, SETTINGS)
    alone = build_floor_map({"a": scans["a"]}, poses, SETTINGS)
    np.testing.assert_array_equal(some.occupancy, alone.occupancy)


@pytest.mark.parametrize(
    ("scans", "poses"),
    [({}, {}), ({"s": scan_of([(1.0, 0.0)])}, {}), ({"s": scan_of([])}, {"s": Pose2.identity()})],
)
def test_nothing_seen_is_an_empty_map(scans, poses):
    floor_map = build_floor_map(scans, poses, SETTINGS)
    assert floor_map.occupancy.shape == (0, 0)
    assert floor_map.resolution == SETTINGS.resolution_m


def test_a_map_too_large_for_memory_becomes_coarser():
    scans = {"a": scan_of([(1.0, 0.0)]), "b": scan_of([(1.0, 0.0)])}
    poses = {"a": Pose2(0.0, 0.0, 0.0), "b": Pose2(0.0, 400.0, 0.0)}
    settings = MappingSettings(resolution_m=0.1, max_cells=20_000)
    # 2 m x 401 m: 84,000 cells of 0.1 m, 22,000 of 0.2 m, 6,000 of 0.4 m.
    floor_map = build_floor_map(scans, poses, settings)
    assert floor_map.resolution == pytest.approx(0.4)
    assert floor_map.occupancy.size <= 20_000
    assert np.nanmax(floor_map.occupancy) > 0.5
