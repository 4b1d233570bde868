"""Stations that would fit elsewhere are found, in repeating buildings and in no others."""

import numpy as np

from slam_uwb.matching.ambiguity import ambiguous_stations
from slam_uwb.matching.merging import no_ranges
from slam_uwb.matching.placement import place_stations


def test_rooms_that_differ_leave_no_station_ambiguous(
    three_room_scans, three_room_hypotheses, settings
):
    block = place_stations(three_room_scans, three_room_hypotheses, settings)[0]
    assert len(block.poses) == 7
    found = ambiguous_stations(block, three_room_scans, three_room_hypotheses, settings, no_ranges)
    assert found == {}


def test_a_station_alone_has_no_place_to_doubt(three_room_scans, settings):
    block = place_stations(three_room_scans, (), settings)[0]
    assert ambiguous_stations(block, three_room_scans, (), settings, no_ranges) == {}


def test_a_second_copy_of_the_room_makes_its_station_ambiguous(
    three_room_scans, three_room_hypotheses, settings
):
    """With walls that deny nothing, a place that confirms as much is as good; ranges may refuse it."""
    block = place_stations(three_room_scans, three_room_hypotheses, settings)[0]
    blind = settings.model_copy(update={"violation_weight": 0.0, "min_margin_m": 1e-3})
    found = ambiguous_stations(block, three_room_scans, three_room_hypotheses, blind, no_ranges)
    assert found
    for station, rival in found.items():
        away = rival.pose.distance_to(block.poses[station])
        assert away > 1.0 or rival.pose.angle_to(block.poses[station]) > 0.5

    def here_alone(_rest, alone, candidates):
        (station,) = alone
        here = block.poses[station].vector
        away = np.abs(candidates - here).max(axis=1)
        return np.where(away > 0.3, -40.0, 0.0)

    refused = ambiguous_stations(block, three_room_scans, three_room_hypotheses, blind, here_alone)
    assert refused == {}
