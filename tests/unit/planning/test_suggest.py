"""Where to measure next: in free space, where the known walls are in view, and where it helps."""

import math

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.settings import PlanningSettings, Settings
from slam_uwb.model.solution import (
    Alternative,
    AnchorEstimate,
    FloorMap,
    FloorPlan,
    Solution,
    StationEstimate,
    Status,
    Wall,
)
from slam_uwb.planning import suggest_stations
from slam_uwb.planning.views import free_places, known_view, walls_between

SETTINGS = PlanningSettings()


def room(width, depth, cell=0.1):
    """Free inside, walls one cell thick round (0, 0) to (width, depth), unknown beyond."""
    columns, rows = round(width / cell) + 6, round(depth / cell) + 6
    grid = np.full((rows, columns), np.nan)
    grid[2:-2, 2:-2] = 0.98
    grid[3:-3, 3:-3] = 0.03
    return FloorMap(grid, cell, (-3 * cell, -3 * cell))


def solution(anchors, stations=((1.0, 1.0),), floor_map=None, plan=None, links=()):
    return Solution(
        survey_name="room", checksum="", mode="joint", settings=Settings(), software_version="", frame="s1",
        stations=tuple(
            StationEstimate(f"s{k}", Pose2(x, y, 0.0), np.eye(3) * 1e-6, Status.OK)
            for k, (x, y) in enumerate(stations, 1)
        ),
        anchors=tuple(anchors), matches=(), links=tuple(links), biases=(), joint_names=(), joint_covariance=None,
        checks=None, floor_map=floor_map or room(8.0, 6.0), scans={}, plan=plan, tag_heights={"s1": 1.4},
    )  # fmt: skip


def anchor(x, y, xx, yy, name="A", **more):
    return AnchorEstimate(name, np.array([x, y]), np.diag([xx, yy]), 1.4, 3, Status.OK, **more)


def test_places_are_free_and_clear_of_walls():
    places = free_places(room(8.0, 6.0), 0.5, 0.6)
    assert len(places) > 50
    assert (places >= 0.55).all()
    assert (places <= [7.45, 5.45]).all()
    assert not len(free_places(FloorMap(np.full((5, 5), np.nan), 0.1, (0, 0)), 0.5, 0.4))


def test_a_closed_room_is_known_and_the_unknown_is_not():
    """From the middle of a room whose right half nobody saw about half of the view ends at walls."""
    closed = room(8.0, 6.0)
    np.testing.assert_allclose(known_view(closed, np.array([[4.0, 3.0]]), 20.0), 1.0)
    half = FloorMap(closed.occupancy.copy(), closed.resolution, closed.origin)
    half.occupancy[:, 43:] = np.nan
    share = known_view(half, np.array([[4.0, 3.0]]), 20.0)[0]
    assert 0.4 < share < 0.6
    # Walls out of reach hold no scan.
    assert known_view(closed, np.array([[4.0, 3.0]]), 2.0)[0] == 0.0


def test_walls_are_counted_by_crossing():
    walls = np.array([[[2.0, 0.0], [2.0, 3.0]], [[4.0, 1.3], [4.0, 3.0]]])
    counts = walls_between(
        walls, np.array([[0.0, 0.5], [0.0, 2.0]]), np.array([[6.0, 1.5], [3.0, 2.0]])
    )
    assert counts.tolist() == [[1, 1], [2, 1]]


def test_the_place_is_along_the_uncertain_direction():
    """An anchor uncertain along y, none along x: a range from above or below tells, from beside it does not."""
    (found,) = suggest_stations(solution([anchor(4.0, 3.0, 1e-4, 1.0)]), 1, SETTINGS)
    away = found.place - [4.0, 3.0]
    assert abs(away[1]) > 3 * abs(away[0])
    # 1 m^2 and a range of 0.12 m: next to nothing is left of it.
    assert found.before == pytest.approx(1.0, abs=1e-3)
    assert found.after < 0.25


def test_kalmans_update_by_hand():
    """Variance 1 along the ray, range variance s^2: 1 - 1 / (1 + s^2) is left, and 1e-8 across."""
    sigma = SETTINGS.sight_sigma_m
    (found,) = suggest_stations(solution([anchor(4.0, 3.0, 1e-8, 1.0)]), 1, SETTINGS)
    slope = abs(found.place[1] - 3.0) / np.linalg.norm(found.place - [4.0, 3.0])
    left = 1.0 - slope**2 / (slope**2 + sigma**2)
    assert found.after == pytest.approx(math.sqrt(left), rel=0.01)


def test_walls_in_between_make_a_place_worth_less():
    """Both sides of the anchor would do as well, but a thick wall stands below it."""
    wall = Wall(np.array([[0.0, 2.5], [8.0, 2.5]]), 0.2, 0.97)
    plan = FloorPlan((), (wall,), np.empty((0, 2, 2)))
    (found,) = suggest_stations(solution([anchor(4.0, 3.0, 1e-4, 1.0)], plan=plan), 1, SETTINGS)
    assert found.place[1] > 3.0


def test_a_second_place_is_where_the_first_leaves_most():
    """Two anchors, each uncertain along y, far apart: one place each, not two at one of them."""
    both = [anchor(1.0, 3.0, 1e-4, 1.0), anchor(7.0, 3.0, 1e-4, 1.0, "B")]
    first, second = suggest_stations(solution(both, stations=((4.0, 1.0),)), 2, SETTINGS)
    assert abs(first.place[0] - second.place[0]) > 2.0
    assert second.before == pytest.approx(first.after)
    assert second.after < second.before


def test_beside_a_station_is_worth_less():
    """Stations above the anchor: the same ranges again from there, or new ones from below."""
    above = ((4.0, 5.0), (4.4, 5.2), (3.6, 5.2))
    (found,) = suggest_stations(
        solution([anchor(4.0, 3.0, 1e-4, 0.05)], stations=above), 1, SETTINGS
    )
    assert found.place[1] < 3.0


def test_a_mirror_image_is_uncertainty_too():
    """Places 2 m apart along y: only a range that changes along y tells them apart."""
    image = Alternative(4.0, 4.0, None, 0.5)
    (found,) = suggest_stations(
        solution([anchor(4.0, 2.0, 1e-4, 1e-4, alternatives=(image,))]), 1, SETTINGS
    )
    # Half a metre's belief at each end: one metre of standard deviation.
    assert found.before == pytest.approx(1.0, abs=1e-3)
    ranges = [np.hypot(*(found.place - [4.0, y])) for y in (2.0, 4.0)]
    assert abs(ranges[0] - ranges[1]) > 4 * SETTINGS.sight_sigma_m
    # What is left of the confusion: exp(-(difference of the ranges)^2 / 8 s^2).
    assert found.after < 0.3


def test_an_anchor_that_too_few_stations_heard_draws_the_tripod_too():
    lost = AnchorEstimate("A", None, None, 1.4, 1, Status.UNREACHABLE)
    heard = LinkMeasurement("s1", "A", 3.0, 3.0, 0.1, 60)
    (found,) = suggest_stations(solution([lost], links=[heard]), 1, SETTINGS)
    # On a ring of 3 m: a standard deviation of 3 m over both axes.
    assert found.before == pytest.approx(math.sqrt(9.0 + 2 * 0.25), rel=0.01)
    assert found.after < found.before


def test_nothing_to_suggest_is_nothing():
    assert suggest_stations(solution([]), 3, SETTINGS) == ()
    never = AnchorEstimate("A", None, None, 1.4, 0, Status.UNREACHABLE)
    assert suggest_stations(solution([never]), 3, SETTINGS) == ()
    closet = solution([anchor(0.3, 0.3, 1, 1)], floor_map=room(0.6, 0.6))
    assert suggest_stations(closet, 3, SETTINGS) == ()
