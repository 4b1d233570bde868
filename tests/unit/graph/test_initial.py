from __future__ import annotations

import math

import numpy as np
import pytest

from slam_uwb.graph.initial import Search, find_point, refine_places
from slam_uwb.graph.range_fit import OffsetPrior
from slam_uwb.graph.sightings import Sightings, mirror_image, spread_ratio
from slam_uwb.model.settings import GraphSettings, RangingSettings
from slam_uwb.model.solution import Status
from slam_uwb.model.survey import RangeOffset
from slam_uwb.ranging import link_model


def search(offset=0.0, sigma=0.05, **settings) -> Search:
    prior = OffsetPrior(RangeOffset(offset, sigma), 0.05)
    return Search(link_model(RangingSettings()), prior, GraphSettings(**settings))


SEARCH = search()
# Without a map any link may cross a wall, so a range is more likely a little long than exact.
LEAN = 0.02
ROOM = np.array([[0.0, 0.0], [4.0, 0.5], [7.5, 0.2], [7.0, 5.0], [3.5, 4.2], [0.5, 5.1]])


def sight(points, place, height=2.5, tag=1.4, errors=0.0) -> Sightings:
    points = np.asarray(points, dtype=float)
    distances = np.sqrt(((points - place) ** 2).sum(axis=1) + (height - tag) ** 2) + errors
    count = len(points)
    return Sightings(points, np.full(count, tag), distances, np.full(count, 0.1))


@pytest.mark.parametrize("place", [(9.0, 6.0), (-2.0, 3.0), (3.7, 2.0), (0.0, 0.0)])
def test_a_point_is_found_exactly_without_noise(place):
    finding = find_point(sight(ROOM, place), 2.5, SEARCH)

    assert finding.status is Status.OK
    np.testing.assert_allclose(finding.place, place, atol=LEAN)


def test_long_ranges_do_not_carry_the_point_away():
    # Every second range goes through walls; least squares is off by more than half a metre.
    errors = np.array([1.5, 0.0, 2.0, 0.0, 0.9, 0.0])
    seen = sight(ROOM, (9.0, 6.0), errors=errors)

    finding = find_point(seen, 2.5, SEARCH)

    assert np.hypot(*(finding.place - (9.0, 6.0))) < 0.3


def test_the_search_reaches_an_anchor_far_outside_of_the_stations():
    finding = find_point(sight(ROOM, (31.0, -12.0)), 2.5, SEARCH)

    np.testing.assert_allclose(finding.place, (31.0, -12.0), atol=2 * LEAN)


def test_a_place_that_fewer_than_half_of_the_ranges_agree_with_is_not_called_ok():
    # Four of six ranges are off by metres, to both sides and to no common place.
    errors = np.array([-4.0, 0.0, 9.0, -3.0, 0.0, -6.0])

    finding = find_point(sight(ROOM, (9.0, 6.0), errors=errors), 2.5, SEARCH)

    assert finding.status is not Status.OK


def test_one_range_far_too_short_does_not_carry_the_point_away():
    # 16 m too short, which no wall can do: a place that explains it makes eleven others long.
    errors = np.zeros(12)
    errors[1] = -16.0
    seen = sight(np.vstack([ROOM, ROOM + 0.8]), (18.0, 9.0), errors=errors)

    finding = find_point(seen, 2.5, SEARCH)

    assert finding.status is Status.OK
    np.testing.assert_allclose(finding.place, (18.0, 9.0), atol=LEAN)


def test_a_range_that_is_too_short_is_a_fault_and_moves_nothing():
    # Twenty stations hold the place against one range that is 5 m short.
    points = np.random.default_rng(0).uniform(0.0, 8.0, (20, 2))
    errors = np.zeros(20)
    errors[3] = -5.0

    faulty, sound = (
        find_point(sight(points, (9.0, 6.0), errors=e), 2.5, SEARCH) for e in (errors, np.zeros(20))
    )

    assert faulty.status is Status.OK
    np.testing.assert_allclose(faulty.place, sound.place, atol=LEAN)


def test_a_place_that_hangs_on_one_wrong_range_is_not_called_ok():
    # The range that is 2.2 m short meets the others 2.4 m away, where the last one is long: likelier, at
    # one fault in fifty links, than that it is one.
    points = np.array([[1.2, 2.9], [3.6, 3.4], [4.1, 1.2], [5.9, 3.8], [7.6, 1.4]])
    seen = sight(points, (3.2, 4.4), errors=np.array([0.0, 0.0, -2.2, 0.0, 0.3]))

    believed = find_point(seen, 2.5, search(0.1, 0.1, fault_cost_gap=0.0))
    finding = find_point(seen, 2.5, search(0.1, 0.1))

    assert believed.status is Status.OK
    assert np.hypot(*(believed.place - (3.2, 4.4))) > 2.0
    assert (finding.status, finding.place) == (Status.MIRROR_AMBIGUOUS, None)
    wrong, right = finding.alternatives
    assert math.hypot(wrong.x - believed.place[0], wrong.y - believed.place[1]) < 1e-6
    assert math.hypot(right.x - 3.2, right.y - 4.4) < 0.2
    assert wrong.weight + right.weight == pytest.approx(1.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_single_gross_fault_makes_a_sure_place_wrong(sign):
    doubted = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        points, place = rng.uniform((0, 0), (9, 6), (8, 2)), rng.uniform((1, 1), (8, 5))
        errors = rng.normal(0.0, 0.06, 8)
        # The farthest one, so that a short range stays a range.
        worst = int(np.argmax(np.hypot(*(points - place).T)))
        errors[worst] += sign * rng.uniform(1.5, 4.0)
        seen = sight(points, place, errors=errors)

        finding = find_point(seen, 2.5, SEARCH)

        if finding.status is not Status.OK:
            doubted += 1
            continue
        fit = refine_places(finding.place[None, :], seen, 2.5, SEARCH)
        covariance = GraphSettings().anchor_inflation * np.linalg.inv(fit.blocks[0])[:2, :2]
        off = finding.place - place
        assert off @ np.linalg.inv(covariance) @ off < 5.0**2
    assert doubted < 4


def test_two_points_do_not_place_a_third():
    finding = find_point(sight(ROOM[:2], (9.0, 6.0)), 2.5, SEARCH)

    assert (finding.status, finding.place, finding.sightings) == (Status.UNREACHABLE, None, 2)


def test_points_in_line_leave_both_mirror_images():
    line = np.column_stack([np.arange(6.0), 0.5 * np.arange(6.0)])
    place = np.array([1.0, 4.0])

    finding = find_point(sight(line, place), 2.5, SEARCH)

    assert (finding.status, finding.place) == (Status.MIRROR_AMBIGUOUS, None)
    found = sorted((other.x, other.y) for other in finding.alternatives)
    # Mirrored across y = x / 2: along (2, 1) / sqrt(5) is 6 / sqrt(5), so twice the foot (2.4, 1.2)
    # minus the point.
    np.testing.assert_allclose(found, [(1.0, 4.0), (3.8, -1.6)], atol=2 * LEAN)


def test_a_point_on_the_line_of_its_stations_is_weak():
    line = np.column_stack([np.arange(6.0), np.zeros(6)])

    finding = find_point(sight(line, (8.0, 0.0)), 2.5, SEARCH)

    assert finding.status is Status.WEAK_GEOMETRY
    assert abs(finding.place[0] - 8.0) < LEAN


def test_the_second_minimum_counts_only_within_the_gap():
    # Stations 0.6 m about a line: the twin is 3 m off and fits visibly worse.
    zigzag = np.column_stack([np.arange(8.0), 0.6 * (-1.0) ** np.arange(8)])
    seen = sight(zigzag, (3.0, 2.0))

    strict = find_point(seen, 2.5, search(mirror_cost_gap=1000.0))
    default = find_point(seen, 2.5, SEARCH)

    assert strict.status is Status.MIRROR_AMBIGUOUS
    assert strict.alternatives[0].weight > 0.9
    np.testing.assert_allclose(default.place, (3.0, 2.0), atol=LEAN)


def test_looking_again_at_the_same_minima_gives_the_same_answer():
    seen = sight(ROOM, (9.0, 6.0), errors=np.array([0.3, 0.0, 0.2, 0.0, 0.0, 0.8]))
    first = find_point(seen, 2.5, SEARCH)

    again = find_point(seen, 2.5, SEARCH, before=first)

    np.testing.assert_allclose(again.place, first.place, atol=1e-5)


def test_the_offset_is_a_nuisance_with_its_prior():
    # Ranges 0.18 m long: with that as the prior's mean the place is exact, with zero it is not.
    seen = sight(ROOM, (3.0, 2.0), errors=np.full(6, 0.18))

    right = find_point(seen, 2.5, search(0.18, 0.10))

    np.testing.assert_allclose(right.place, (3.0, 2.0), atol=LEAN)


def test_refining_ends_in_a_minimum():
    seen = sight(ROOM, (9.0, 6.0), errors=np.array([0.4, -0.1, 0.9, 0.05, 0.0, 1.2]))

    fit = refine_places(np.array([[8.0, 5.0]]), seen, 2.5, SEARCH)
    (place,), (cost,) = fit.places, fit.costs

    ring = place + 0.01 * np.array([[math.cos(t), math.sin(t)] for t in np.arange(0, 6.28, 0.4)])
    around = refine_places(ring, seen, 2.5, SEARCH).places
    np.testing.assert_allclose(around, np.tile(place, (len(ring), 1)), atol=1e-4)
    assert cost > 0.0


def test_spread_ratio_by_hand():
    # A rectangle 4 x 2: singular values in the ratio of its sides.
    corners = np.array([[0, 0], [4, 0], [4, 2], [0, 2]], dtype=float)

    assert spread_ratio(corners) == pytest.approx(0.5)
    assert spread_ratio(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])) == pytest.approx(0.0)
    assert spread_ratio(np.zeros((3, 2))) == 0.0


def test_mirroring_twice_is_nothing():
    line = np.array([[0.0, 1.0], [2.0, 2.0], [5.0, 3.5]])
    place = np.array([[3.0, -1.0]])

    np.testing.assert_allclose(mirror_image(mirror_image(place, line), line), place)
