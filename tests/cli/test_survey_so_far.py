"""What the operator is told between two stations."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.cli import survey_so_far
from slam_uwb.cli.next_place import find_next_place
from slam_uwb.cli.text_map import draw_text_map
from slam_uwb.io import read_solution
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.solution import Status

WAY = re.compile(
    r"([\d.]+) m (.+) the scanner \((\d+) deg (left|right) of its forward mark\) at (\S+?), ([\d.]+) m from"
)


@pytest.fixture(scope="module")
def solved(pristine_solution):
    return read_solution(pristine_solution)


def turned(solution, theta):
    """The same survey, had the tripod been set down turned at every station."""
    stations = tuple(
        s if s.pose is None else replace(s, pose=Pose2(s.pose.x, s.pose.y, s.pose.theta + theta))
        for s in solution.stations
    )
    return replace(solution, stations=stations)


@pytest.mark.parametrize("theta", [0.0, 1.0, 2.5, -2.0])
def test_the_words_lead_to_the_place(solved, theta):
    solution = turned(solved, theta)
    for station in solution.stations:
        place = find_next_place(solution, station.id)
        distance, side, degrees, hand, name, _ = WAY.match(place.words).groups()
        assert name == station.id
        bearing = math.radians(float(degrees)) * (1.0 if hand == "left" else -1.0)
        there = station.pose.transform(
            float(distance) * np.array([[math.cos(bearing), math.sin(bearing)]])
        )[0]
        # Rounded to a decimetre and a degree.
        assert math.dist(there, place.place) < 0.06 + float(distance) * math.radians(0.6)
        assert ("left" in side) == (22.5 < math.degrees(bearing) < 157.5)
        assert ("ahead" in side) == (abs(math.degrees(bearing)) < 67.5)


def test_the_place_can_be_stood_at_and_is_drawn(solved):
    place = find_next_place(solved, solved.stations[0].id).place
    floor = solved.floor_map
    column, row = ((place - np.array(floor.origin)) / floor.resolution).astype(int)
    assert floor.free[row, column]
    assert sum(line.count("x") for line in draw_text_map(solved, place=place)) == 1
    assert not any("x" in line for line in draw_text_map(solved))


def test_from_the_last_placed_station_where_the_present_one_is_not(solved):
    *others, last = solved.stations
    lost = replace(last, pose=None, covariance=None, status=Status.DISCONNECTED)
    solution = replace(solved, stations=(*others, lost))
    assert f"at {others[-1].id}," in find_next_place(solution, last.id).words


def test_without_a_heading_there_is_no_direction(solved):
    stations = tuple(replace(s, heading_known=False) for s in solved.stations)
    words = find_next_place(replace(solved, stations=stations), stations[0].id).words
    assert re.match(rf"[\d.]+ m from {stations[0].id}, ", words)
    assert "left" not in words
    assert "right" not in words


def test_nothing_is_suggested_without_a_map_or_anchors(solved):
    name = solved.stations[0].id
    assert find_next_place(replace(solved, floor_map=None), name) is None
    assert find_next_place(replace(solved, anchors=(), links=()), name) is None
    unplaced = tuple(replace(s, pose=None, status=Status.DISCONNECTED) for s in solved.stations)
    assert find_next_place(replace(solved, stations=unplaced), name) is None


def test_the_operator_does_not_wait_for_ever(pristine_survey, capsys, monkeypatch):
    monkeypatch.setattr(survey_so_far, "PATIENCE_S", 0.0)
    survey_so_far.show_survey_so_far(pristine_survey, "s01")
    told = capsys.readouterr().out
    assert "not solved within 0 s" in told
    assert "slam-uwb solve" in told


def test_what_is_not_placed_is_named(pristine_survey, capsys, monkeypatch, solved):
    *others, last = solved.stations
    lost = replace(last, pose=None, covariance=None, status=Status.DISCONNECTED)
    solution = replace(solved, stations=(*others, lost))
    monkeypatch.setattr("slam_uwb.pipeline.solve_survey", lambda *_, **__: solution)
    survey_so_far.show_survey_so_far(pristine_survey, last.id)
    told = capsys.readouterr().out
    assert f"station {last.id} not placed; " in told
    assert f"not placed: {last.id} (disconnected: nothing holds it to the map)" in told
    assert told.count("  anchor ") == len(solved.anchors)
    # Every anchor with the number of stations that hear it.
    for anchor in solved.anchors:
        heard = {k.station for k in solved.links if k.anchor == anchor.id}
        assert f"  anchor {anchor.id}, heard at {len(heard)}: " in told
    assert "next (x in the map): " in told
