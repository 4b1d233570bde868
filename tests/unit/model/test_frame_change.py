"""Another frame changes where things are, never how far apart or how sure."""

from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.frame_change import change_frame, fit_frame, main_direction
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.solution import (
    Alternative,
    AnchorEstimate,
    GraphEstimate,
    StationEstimate,
    Status,
)

SITE_T_WORLD = Pose2(10.0, -4.0, 0.7)


@pytest.fixture
def estimate():
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(7, 7))
    joint = factor @ factor.T * 1e-3
    stations = (StationEstimate("s1", Pose2(1.0, 2.0, 0.4), joint[:3, :3], Status.OK),)
    anchors = (
        AnchorEstimate("A", np.array([3.0, 1.0]), joint[3:5, 3:5], 2.0, 3, Status.OK),
        AnchorEstimate("B", np.array([0.0, 5.0]), joint[5:, 5:], 2.0, 3, Status.MIRROR_AMBIGUOUS,
                       (Alternative(1.0, 1.0, None, 0.3),)),
    )  # fmt: skip
    return GraphEstimate(stations, anchors, (), "s1", (), ("s1", "A", "B"), joint)


def test_places_move_with_the_frame(estimate):
    moved = change_frame(estimate, SITE_T_WORLD)
    assert moved.stations[0].pose == SITE_T_WORLD @ estimate.stations[0].pose
    np.testing.assert_allclose(moved.anchors[0].position, SITE_T_WORLD.transform([3.0, 1.0]))
    other = moved.anchors[1].alternatives[0]
    np.testing.assert_allclose([other.x, other.y], SITE_T_WORLD.transform([1.0, 1.0]))
    assert other.theta is None


def test_back_again_is_the_same(estimate):
    back = change_frame(change_frame(estimate, SITE_T_WORLD), SITE_T_WORLD.inverse())
    np.testing.assert_allclose(back.joint_covariance, estimate.joint_covariance, atol=1e-15)
    np.testing.assert_allclose(
        back.anchors[0].covariance, estimate.anchors[0].covariance, atol=1e-15
    )
    assert back.stations[0].pose.distance_to(estimate.stations[0].pose) < 1e-12


def test_covariances_turn_with_the_anchors_and_stay_with_the_stations(estimate):
    moved = change_frame(estimate, SITE_T_WORLD)
    turn = SITE_T_WORLD.rotation
    np.testing.assert_allclose(
        moved.anchors[0].covariance, turn @ estimate.anchors[0].covariance @ turn.T
    )
    np.testing.assert_array_equal(moved.stations[0].covariance, estimate.stations[0].covariance)
    # The blocks of the joint covariance are those of the items.
    np.testing.assert_allclose(moved.joint_covariance[:3, :3], moved.stations[0].covariance)
    np.testing.assert_allclose(moved.joint_covariance[3:5, 3:5], moved.anchors[0].covariance)
    np.testing.assert_allclose(
        moved.joint_covariance[:3, 3:5], estimate.joint_covariance[:3, 3:5] @ turn.T
    )


def test_a_station_without_heading_turns_as_an_anchor_does(estimate):
    blind = replace(estimate.stations[0], heading_known=False, pose=Pose2(1.0, 2.0, 0.0))
    moved = change_frame(replace(estimate, stations=(blind,)), SITE_T_WORLD)
    assert moved.stations[0].pose.theta == 0.0
    turn = SITE_T_WORLD.rotation
    expected = turn @ estimate.stations[0].covariance[:2, :2] @ turn.T
    np.testing.assert_allclose(moved.stations[0].covariance[:2, :2], expected)
    np.testing.assert_allclose(moved.joint_covariance[:2, :2], expected)


def test_known_places_give_the_frame_back(estimate):
    known = {name: tuple(SITE_T_WORLD.transform(place)) for name, place in
             {"s1": [1.0, 2.0], "A": [3.0, 1.0], "B": [0.0, 5.0]}.items()}  # fmt: skip
    for count in (2, 3):
        found = fit_frame(estimate, dict(list(known.items())[:count]))
        assert found.distance_to(SITE_T_WORLD) < 1e-9
        assert found.angle_to(SITE_T_WORLD) < 1e-9


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"A": (0.0, 0.0)}, "two points"),
        ({"A": (0.0, 0.0), "Z": (1.0, 0.0)}, "Z has no place"),
        ({"A": (1.0, 0.0), "B": (1.0, 0.0)}, "coincide"),
    ],
)
def test_what_fixes_no_frame_is_refused(estimate, known, message):
    with pytest.raises(SlamUwbError, match=message):
        fit_frame(estimate, known)


@pytest.mark.parametrize("angle", [-0.7, -0.2, 0.0, 0.3, 0.78])
def test_main_direction_of_walls_at_right_angles(angle):
    """Long walls both ways round and a short oblique one, which hardly counts."""
    turn = Pose2(1.0, 2.0, angle)
    walls = np.array([[[0, 0], [9, 0]], [[9, 0], [9, 5]], [[9, 5], [0, 5]]], float)
    turned = turn.transform(walls.reshape(-1, 2)).reshape(-1, 2, 2)
    assert main_direction(turned) == pytest.approx(angle, abs=1e-9)
    oblique = np.array([[[0.0, 0.0], [0.3, 0.1]]])
    assert main_direction(np.concatenate([turned, oblique])) == pytest.approx(angle, abs=0.02)
