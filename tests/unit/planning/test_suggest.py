"""Where to measure next: in free space, where the known walls are in view, and where it helps."""

import math

import numpy as np
import pytest

from slam_uwb.model.floor import FloorMap, FloorPlan, Wall
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.settings import PlanningSettings, Settings
from slam_uwb.model.solution import Alternative, AnchorEstimate, Solution, StationEstimate, Status
from slam_uwb.planning import suggest_stations
from slam_uwb.planning.belief import build_beliefs
from slam_uwb.planning.radio import hearing_probability, link_budget
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
    """Variance 1 along the ray, range variance s^2: 1 - 1 / (1 + s^2) is left, and 1e-8 across.

    The station d away has told r = exp(-d / 1 m) of the error already: s^2 counts (1 + r) / (1 - r) fold.
    """
    (found,) = suggest_stations(solution([anchor(4.0, 3.0, 1e-8, 1.0)]), 1, SETTINGS)
    r = math.exp(-np.linalg.norm(found.place - [1.0, 1.0]) / SETTINGS.shared_radius_m)
    variance = SETTINGS.sight_sigma_m**2 * (1.0 + r) / (1.0 - r)
    slope = abs(found.place[1] - 3.0) / np.linalg.norm(found.place - [4.0, 3.0])
    # One range in ten thousand is not heard even there.
    heard = hearing_probability(np.array(0.0), np.linalg.norm(found.place - [4.0, 3.0]), 36.0)
    left = 1.0 - heard * slope**2 / (slope**2 + variance)
    assert found.after == pytest.approx(math.sqrt(left), rel=1e-4)


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


def test_two_places_that_one_range_tells_apart_are_not_one_blurred_place():
    """At either place the range comes from another side; neither is what the mean of both would say."""
    image = Alternative(7.0, 5.0, None, 0.5)
    beliefs = build_beliefs(solution([anchor(1.0, 5.0, 0.01, 0.04, alternatives=(image,))]))
    np.testing.assert_allclose(beliefs.means, [[7.0, 5.0], [1.0, 5.0]])
    np.testing.assert_allclose(beliefs.covariances, [np.diag([0.01, 0.04])] * 2, atol=1e-7)
    # Half a belief each, 6 m apart: 1/4 of 36 m^2.
    np.testing.assert_allclose(beliefs.spreads, [9.0])


def test_second_place_is_not_beside_the_first():
    """A lost anchor wants two ranges from different sides: beside the first the same walls spoil both."""
    lost = AnchorEstimate("A", None, None, 1.4, 1, Status.UNREACHABLE)
    heard = LinkMeasurement("s1", "A", 5.0, 5.0, 0.1, 60)
    first, second = suggest_stations(solution([lost], links=[heard]), 2, SETTINGS)
    assert np.linalg.norm(first.place - second.place) > SETTINGS.shared_radius_m


def test_a_place_that_hears_nothing_tells_nothing():
    """Behind five walls; the way to see that anchor is on their other side."""
    walls = tuple(Wall(np.array([[x, 0.0], [x, 6.0]]), 0.1, 0.97) for x in np.linspace(4.0, 4.8, 5))
    plan = FloorPlan((), walls, np.empty((0, 2, 2)))
    (found,) = suggest_stations(solution([anchor(7.5, 3.0, 1.0, 1.0)], plan=plan), 1, SETTINGS)
    assert found.place[0] > 4.8
    one = hearing_probability(np.array([0.0, 5.0]), np.array([5.0, 5.0]), 36.0)
    assert one[0] > 0.99
    assert one[1] < 0.2


def test_what_the_survey_heard_says_what_will_be_heard():
    """Thirty-six links over 2 to 40 m without walls: heard up to 20 m, or all of them.

    20 m cost 26 dB, the next place 21 m costs 26.4: the budget is between, where the prior lets it.
    """
    distances = np.arange(2.0, 41.0)
    stations = tuple((float(d), 0.0) for d in distances)
    target = anchor(0.0, 0.0, 0.01, 0.01)

    def heard(reach):
        return [
            LinkMeasurement(f"s{k}", "A", d, d, 0.1, 60)
            for k, d in enumerate(distances, 1)
            if d <= reach
        ]

    near = link_budget(solution([target], stations=stations, links=heard(20.0)))
    assert near == pytest.approx(26.5, abs=1.5)
    assert link_budget(solution([target], stations=stations, links=heard(99.0))) > 36.0
    # A survey without any range is no proof that nothing can be heard.
    assert link_budget(solution([target], stations=stations)) == 36.0


def test_a_scan_that_may_not_match_is_worth_less():
    """Left and right see the anchor alike, but nobody has seen the wall on the right."""
    floor_map = room(8.0, 6.0)
    floor_map.occupancy[:, 50:] = np.nan
    (found,) = suggest_stations(
        solution([anchor(2.35, 3.0, 1.0, 1e-4)], ((2.35, 0.8),), floor_map=floor_map), 1, SETTINGS
    )
    assert found.place[0] < 2.35
    assert found.known_view >= SETTINGS.sure_known_view


def test_an_anchor_beyond_use_does_not_outweigh_the_others():
    """A lost one that no place can bring below a metre, and one that a range would make good.

    The lost one's variance falls by far more square metres, to nobody's use.
    """
    walls = tuple(
        Wall(np.array([[0.0, 6.5 + 0.05 * k], [99.0, 6.5 + 0.05 * k]]), 0.1, 0.97) for k in range(2)
    )
    lost = AnchorEstimate("L", np.array([60.0, 9.0]), np.diag([1e-4, 90.0]), 1.4, 3, Status.OK)
    near = anchor(1.0, 3.0, 1e-4, 0.6)
    plan = FloorPlan((), walls, np.empty((0, 2, 2)))
    (found,) = suggest_stations(solution([lost, near], ((6.0, 3.0),), plan=plan), 1, SETTINGS)
    away = found.place - [1.0, 3.0]
    assert abs(away[1]) > 2 * abs(away[0])


def test_nothing_to_suggest_is_nothing():
    assert suggest_stations(solution([]), 3, SETTINGS) == ()
    never = AnchorEstimate("A", None, None, 1.4, 0, Status.UNREACHABLE)
    assert suggest_stations(solution([never]), 3, SETTINGS) == ()
    closet = solution([anchor(0.3, 0.3, 1, 1)], floor_map=room(0.6, 0.6))
    assert suggest_stations(closet, 3, SETTINGS) == ()
