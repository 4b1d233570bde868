from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.simulate import Lidar, Radio, Scene, simulate_survey

SHORT = Lidar(duration=2.0, upper_duration=1.0)
BRIEF = Radio(duration=6.0)


def contents(simulation):
    """Every number of a survey, by name."""
    found = {}
    for station in simulation.survey.stations:
        for kind, scan in (("scan", station.scan), ("upper", station.upper_scan)):
            found[station.id, kind] = np.stack([scan.bearings, scan.ranges])
        place = simulation.reference.stations[station.id]
        found[station.id, "place"] = np.array([place.x, place.y, place.theta])
    for link in simulation.survey.ranges:
        found[link.station, link.anchor] = link.distances
    for link in simulation.survey.periods:
        found[link.station, link.anchor, "periods"] = link.periods
    return found


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.parametrize("two_way", [False, True])
def test_the_same_seed_is_the_same_survey(two_way):
    one, same, other = (
        simulate_survey("twin-rooms", seed, lidar=SHORT, radio=BRIEF, two_way=two_way)
        for seed in (3, 3, 4)
    )
    assert_equal(contents(one), contents(same))
    assert one.link_truth == same.link_truth
    for name in [("s01", "scan"), ("s05", "upper"), ("s02", "place")]:
        assert not np.array_equal(contents(one)[name], contents(other)[name], equal_nan=True)
    assert one.link_truth != other.link_truth


def test_what_comes_later_does_not_change_what_came_before():
    whole = simulate_survey("corridor", 2, lidar=SHORT, radio=BRIEF)
    site = whole.scene
    first = replace(
        site,
        stations=site.stations[:5],
        sequence=tuple(pair for pair in site.sequence if max(pair) < 5),
    )
    part = contents(simulate_survey(first, 2, lidar=SHORT, radio=BRIEF))
    assert {name[0] for name in part} == {"s01", "s02", "s03", "s04", "s05"}
    assert_equal(part, {name: value for name, value in contents(whole).items() if name in part})


def test_a_scene_in_hand_is_the_scene_by_name():
    by_name = simulate_survey("flat", 1, lidar=SHORT, radio=BRIEF)
    in_hand = simulate_survey(by_name.scene, 1, lidar=SHORT, radio=BRIEF)
    assert in_hand.survey.name == by_name.survey.name == "flat-1"
    assert_equal(contents(by_name), contents(in_hand))


def test_every_setup_has_a_heading_of_its_own():
    simulation = simulate_survey("paper-office", 1, lidar=SHORT, radio=BRIEF)
    headings = np.array([place.theta for place in simulation.reference.stations.values()])
    assert len(np.unique(headings)) == 18
    assert np.ptp(headings) > np.pi
    assert np.abs(headings).max() <= np.pi


def test_the_raised_scan_is_turned_on_its_own(hall: Scene):
    exact = Lidar.noise_free(2.0, 2.0)
    station = simulate_survey(hall, 0, lidar=exact, radio=BRIEF).survey.stations[0]
    # Both see the same bare walls, so the nearest wall stands at another bearing only if the heading differs.
    nearest = [
        scan.bearings[np.nanargmin(scan.ranges)] for scan in (station.scan, station.upper_scan)
    ]
    assert abs(np.angle(np.exp(2j * (nearest[0] - nearest[1])))) > 0.05


def test_recordings_are_as_long_as_asked():
    simulation = simulate_survey("twin-rooms", 0, lidar=SHORT, radio=Radio.noise_free(10.0))
    for station in simulation.survey.stations:
        assert len(station.scan.ranges) == 1000
        assert len(station.upper_scan.ranges) == 500
        assert station.upper_scan_height == 2.5
    assert {len(link.distances) for link in simulation.survey.ranges} == {20}


def test_the_raised_scan_can_be_left_out():
    simulation = simulate_survey(
        "twin-rooms", 0, lidar=Lidar(duration=1.0, upper_duration=0.0), radio=BRIEF
    )
    assert all(
        s.upper_scan is None and s.upper_scan_height is None for s in simulation.survey.stations
    )


def test_the_sequence_reaches_every_station_or_is_not_told():
    told = simulate_survey("paper-office", 0, lidar=SHORT, radio=BRIEF).survey
    assert told.sequence[:2] == (("s01", "s02"), ("s02", "s03"))
    assert {"s01", *(n for _, n in told.sequence)} == {station.id for station in told.stations}
    assert (
        simulate_survey("paper-office", 0, lidar=SHORT, radio=BRIEF, sequence=False).survey.sequence
        is None
    )


def test_the_reference_is_where_things_stand():
    simulation = simulate_survey("flat", 9, lidar=SHORT, radio=BRIEF)
    for k, (name, place) in enumerate(simulation.reference.stations.items()):
        assert name == f"s{k + 1:02d}"
        np.testing.assert_array_equal([place.x, place.y], simulation.scene.stations[k])
    for k, (name, place) in enumerate(simulation.reference.anchors.items()):
        assert name == f"A{k + 1}"
        np.testing.assert_array_equal([place.x, place.y], simulation.scene.anchors[k, :2])
        assert simulation.survey.anchor(name).height == simulation.scene.anchors[k, 2]


def test_the_truth_of_a_link_is_what_its_samples_are_too_long_by():
    simulation = simulate_survey(
        "flat", 6, lidar=SHORT, radio=replace(Radio(), jitter=0.0, range_step=0.0)
    )
    assert len(simulation.link_truth) == 50
    for link in simulation.survey.ranges:
        place, anchor = (
            simulation.reference.stations[link.station],
            simulation.reference.anchors[link.anchor],
        )
        rise = simulation.survey.anchor(link.anchor).height - 1.4
        slant = np.sqrt((place.x - anchor.x) ** 2 + (place.y - anchor.y) ** 2 + rise**2)
        np.testing.assert_allclose(
            link.distances - slant, simulation.link_truth[link.station, link.anchor][1], atol=1e-9
        )
