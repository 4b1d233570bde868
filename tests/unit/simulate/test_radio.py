from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.simulate import Radio, simulate_survey
from slam_uwb.simulate.lidar import Lidar
from slam_uwb.simulate.radio import (
    SPEED_OF_LIGHT,
    Device,
    LinkTruth,
    count_exchanges,
    draw_device,
    draw_link,
    furniture_crossed,
    sample_periods,
    sample_ranges,
    walls_crossed,
)

QUICK = Lidar(duration=0.1, upper_duration=0.0)
PERFECT = Device(0.0, 0.0)
TAG = np.array([2.0, 0.5, 1.4])


def errors(scene, anchor, radio, count=3000, seed=0):
    rng = np.random.default_rng(seed)
    links = [
        draw_link(scene, TAG, scene.anchors[anchor], PERFECT, radio, rng) for _ in range(count)
    ]
    return np.array([link.error for link in links]), np.array([link.success for link in links])


def test_link_errors_are_those_of_the_real_links():
    # Written down once from the measured links; an estimator's result is no reason to change them.
    radio = Radio()
    assert (radio.offset, radio.anchor_sigma, radio.link_sigma) == (0.18, 0.05, 0.07)
    assert (radio.wall_delay, radio.wall_shape, radio.furniture_delay) == (0.40, 1.3, 0.13)
    assert (radio.jitter, radio.rate) == (0.025, 10.0)


def test_walls_are_counted_once_and_doors_not_at_all(three_rooms):
    # Anchors A1 and A2 one room on, A3 and A4 two; y = 1.5 passes through the door, y = 0.5 does not.
    count = [
        walls_crossed(three_rooms, np.tile(s, (4, 1)), three_rooms.anchors[:, :2])
        for s in three_rooms.stations
    ]
    # From (2, 1.5) to (6, 0.5) the wall at x = 4 is met at y = 1.0, just at the door's edge: left out.
    assert count[0][[0, 2, 3]].tolist() == [0, 1, 1]
    # From (2, 0.5): to (6, 1.5) met at y = 1.0, left out; (6, 0.5) 1; (10, 1.5) met at 0.75: 2; (10, 0.5) 2.
    assert count[1][[1, 2, 3]].tolist() == [1, 2, 2]
    assert count[2].tolist() == [0, 0, 1, 1]


def test_furniture_counts_where_the_path_is_below_its_top(hall):
    # From 1.4 m up to 2.4 m over 4 m: 1.65 m high at a cupboard 1 m away, 2.15 m at 3 m.
    tag, anchor = np.array([5.0, 3.0, 1.4]), np.array([9.0, 3.0, 2.4])
    near, far = np.array([[[6, 2], [6, 4]]], float), np.array([[[8, 2], [8, 4]]], float)
    height = np.array([1.8])
    assert furniture_crossed(replace(hall, furniture=near, furniture_heights=height), tag, anchor)
    assert not furniture_crossed(
        replace(hall, furniture=far, furniture_heights=height), tag, anchor
    )
    assert not furniture_crossed(hall, tag, anchor)


@pytest.mark.parametrize(("anchor", "walls"), [(1, 1), (3, 2)])
def test_each_wall_adds_a_gamma_delay(three_rooms, anchor, walls):
    radio = Radio()
    found, _ = errors(three_rooms, anchor, radio)
    # Mean n tau, variance n tau^2 / shape, plus the link's own.
    variance = walls * 0.4**2 / 1.3 + 0.07**2
    assert found.mean() == pytest.approx(0.18 + 0.4 * walls, abs=4 * np.sqrt(variance / len(found)))
    assert found.var() == pytest.approx(variance, rel=0.2)
    skewed = ((found - found.mean()) ** 3).mean() / found.std() ** 3
    assert skewed > 0.8
    assert found.max() > 0.18 + 0.4 * walls + 1.0


def test_in_line_of_sight_the_error_is_the_offset_with_little_spread(three_rooms):
    scene = replace(three_rooms, partitions=np.empty((0, 2, 2)))
    found, _ = errors(scene, 0, Radio())
    assert found.mean() == pytest.approx(0.18, abs=4 * 0.07 / np.sqrt(len(found)))
    assert found.std() == pytest.approx(0.07, rel=0.06)


def test_furniture_adds_little(hall):
    # A cupboard of 2 m round the tag hides every anchor.
    scene = replace(
        hall, furniture=np.array([[[3, 1], [3, -1]]], float), furniture_heights=np.array([2.0])
    )
    scene = replace(scene, anchors=np.array([[4.0, 0.5, 1.9]]))
    hidden, _ = errors(scene, 0, Radio())
    assert hidden.mean() == pytest.approx(0.18 + 0.13, abs=0.012)


def test_anchors_have_delays_of_their_own():
    rng = np.random.default_rng(0)
    delays = np.array([draw_device(Radio(), rng).delay for _ in range(4000)])
    assert delays.std() == pytest.approx(0.05, rel=0.05)
    assert abs(delays.mean()) < 4 * 0.05 / np.sqrt(4000)


def test_an_anchors_delay_is_in_all_its_links(three_rooms):
    radio = replace(Radio(), link_sigma=0.0, wall_delay=0.0, anchor_sigma=0.5)
    truth = simulate_survey(three_rooms, 1, lidar=QUICK, radio=radio).link_truth
    by_anchor = {}
    for (_, anchor), (_, error) in truth.items():
        by_anchor.setdefault(anchor, set()).add(round(error, 9))
    assert all(len(found) == 1 for found in by_anchor.values())
    assert len(set.union(*by_anchor.values())) == 4


def test_every_link_has_an_error_of_its_own(three_rooms):
    truth = simulate_survey(three_rooms, 1, lidar=QUICK).link_truth
    assert len({round(error, 9) for _, error in truth.values()}) == len(truth) == 12


def test_losses_grow_with_walls_until_nothing_is_heard():
    site = [simulate_survey("corridor", seed, lidar=QUICK) for seed in range(6)]
    share = {walls: [] for walls in range(4)}
    for simulation in site:
        heard = {(r.station, r.anchor): len(r.distances) for r in simulation.survey.ranges}
        for link, (walls, _) in simulation.link_truth.items():
            if walls in share:
                share[walls].append(heard.get(link, 0) > 0)
    found = [np.mean(share[walls]) for walls in range(4)]
    assert found[0] == 1.0
    assert found[0] >= found[1] > found[2] > found[3]
    assert found[3] < 0.3


def test_weak_links_lose_more_of_their_exchanges(three_rooms):
    open_plan = replace(three_rooms, partitions=np.empty((0, 2, 2)))
    clear = errors(open_plan, 1, Radio(), 300)[1].mean()
    one, two = (errors(three_rooms, anchor, Radio(), 300)[1].mean() for anchor in (1, 3))
    assert 0.98 >= clear > one > two


def test_a_link_varies_little_round_its_constant_error():
    link = LinkTruth(5.0, 1, 0.75, 1.0)
    samples = sample_ranges(link, 20_000, Radio(), np.random.default_rng(0))
    assert samples.mean() == pytest.approx(5.75, abs=4 * 0.025 / np.sqrt(20_000))
    assert samples.std() == pytest.approx(0.025, rel=0.03)
    np.testing.assert_allclose(samples * 1000, np.round(samples * 1000), atol=1e-6)


def test_the_rate_is_shared_by_the_anchors_that_answer():
    links = [LinkTruth(5.0, 0, 0.0, success) for success in (0.98,) * 6 + (0.0,)]
    assert count_exchanges(links, Radio()) == 100
    assert count_exchanges([*links, links[0]], Radio()) == 85
    assert count_exchanges(links[6:], Radio()) == 600


@pytest.mark.parametrize("two_way", [False, True])
def test_without_errors_ranges_are_slant_distances(two_way):
    radio = replace(Radio.noise_free(6.0), tag_offset=(0.1, -0.05))
    simulation = simulate_survey("flat", 2, lidar=QUICK, radio=radio, two_way=two_way)
    survey, reference = simulation.survey, simulation.reference
    assert len(survey.periods if two_way else survey.ranges) == 50
    assert (survey.ranges if two_way else survey.periods) == ()
    for link in survey.periods if two_way else survey.ranges:
        place, anchor = reference.stations[link.station], reference.anchors[link.anchor]
        c, s = np.cos(place.theta), np.sin(place.theta)
        tag = (place.x + 0.1 * c + 0.05 * s, place.y + 0.1 * s - 0.05 * c)
        rise = survey.anchor(link.anchor).height - survey.station(link.station).tag_height
        slant = np.sqrt((tag[0] - anchor.x) ** 2 + (tag[1] - anchor.y) ** 2 + rise**2)
        found = (
            link.periods @ [0.25, -0.25, -0.25, 0.25] * SPEED_OF_LIGHT
            if two_way
            else link.distances
        )
        assert len(found) == 12
        np.testing.assert_allclose(found, slant, atol=1e-9)
        assert simulation.link_truth[link.station, link.anchor][1] == 0.0


def test_two_way_periods_follow_the_paper():
    fast, slow = Device(0.0, 15e-6), Device(0.0, -15e-6)
    link = LinkTruth(8.0, 0, 0.2, 1.0)
    t1, t2, t3, t4 = sample_periods(link, 4000, fast, slow, Radio(), np.random.default_rng(0)).T
    symmetric = (t1 - t2 + t4 - t3) / 4 * SPEED_OF_LIGHT
    # Asymmetry of at most 1 us at 30 ppm apart: 1e-6 * 30e-6 / 4 * c = 2.2 mm; jitter 2.5 cm.
    assert symmetric.mean() == pytest.approx(8.2, abs=0.003)
    assert symmetric.std() == pytest.approx(0.025, rel=0.05)
    # One side alone carries the clocks: (T1 - T2) / 2 errs by 300 us * 30 ppm / 2 * c = 1.35 m.
    single = (t1 - t2) / 2 * SPEED_OF_LIGHT
    assert single.mean() - 8.2 == pytest.approx(1.35, abs=0.02)


def test_clocks_stay_within_their_tolerance():
    rng = np.random.default_rng(0)
    clocks = np.array([draw_device(Radio(), rng).clock_error for _ in range(1000)])
    assert np.abs(clocks).max() <= 20e-6
    assert np.abs(clocks).max() > 19e-6


def test_settings_without_sense_are_refused():
    with pytest.raises(ValueError, match="rate"):
        Radio(rate=-1.0)
