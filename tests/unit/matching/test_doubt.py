"""What the solvers had no place for and fits at several places is named so."""

import math

import numpy as np
import pytest

from slam_uwb.matching import Selection, name_ambiguous, repeating_building
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.solution import Alternative, GraphEstimate, StationEstimate, Status


def placed(name, pose):
    return StationEstimate(name, pose, np.eye(3), Status.OK)


def lost(name):
    return StationEstimate(name, None, None, Status.DISCONNECTED)


def selection(placement, ambiguous):
    return Selection(placement, (), (), ambiguous)


def test_places_come_in_the_frame_of_the_estimate():
    """a stands at (5, 0) and looks along y: 1 m ahead of it is (5, 1), 2 m ahead (5, 2)."""
    estimate = GraphEstimate((placed("a", Pose2(5.0, 0.0, math.pi / 2)), lost("b")), (), (), "site")
    places = ((Pose2(1.0, 0.0, 0.0), 0.6), (Pose2(2.0, 0.0, 0.0), 0.4))
    named = name_ambiguous(estimate, selection({"a": Pose2.identity()}, {"b": places}))
    assert named.stations[0] is estimate.stations[0]
    assert named.stations[1].status is Status.AMBIGUOUS
    assert named.stations[1].pose is None
    found = [(p.x, p.y, p.theta, p.weight) for p in named.stations[1].alternatives]
    assert found[0] == pytest.approx((5.0, 1.0, math.pi / 2, 0.6))
    assert found[1] == pytest.approx((5.0, 2.0, math.pi / 2, 0.4))
    assert isinstance(named.stations[1].alternatives[0], Alternative)


def test_a_station_that_the_solver_placed_all_the_same_stays():
    """Ranges or a survey may tell what the scans cannot."""
    stations = (placed("a", Pose2.identity()), placed("b", Pose2(1.0, 0.0, 0.0)), lost("c"))
    estimate = GraphEstimate(stations, (), (), "a")
    places = {"b": ((Pose2(1.0, 0.0, 0.0), 1.0),)}
    assert name_ambiguous(estimate, selection({"a": Pose2.identity()}, places)).stations == stations


def test_without_a_station_in_common_nothing_can_be_said():
    estimate = GraphEstimate((lost("a"), lost("b")), (), (), "site")
    assert name_ambiguous(estimate, selection({"a": Pose2.identity()}, {"b": ()})) is estimate


def test_a_building_that_repeats_itself_is_told_by_its_stations():
    error = repeating_building(selection({}, {"s1": (), "s2": ()}))
    assert "every station fits at more than one place (s1, s2)" in str(error)
    assert error.exit_status == 3
