"""Another frame changes where things are, never how far apart or how sure."""

from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.frame_change import (
    DrawnPlan,
    change_frame,
    fit_frame,
    fit_picture,
    main_direction,
    misfits,
)
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


def drawn(points, pixels_a_cell=2.0):
    """A picture of 400 x 300 pixels, kept at half of that."""
    return DrawnPlan(np.zeros((150, 200)), pixels_a_cell, 300.0, points)


def test_two_points_of_a_picture_give_frame_and_scale(estimate):
    """In the world A is at (3, 1) and s1 at (1, 2). Drawn 25 pixels a metre, a metre up being 25 rows up, and
    turned by 90 degrees: (x, y) m in the world is at (2 - y, x) m + (4, 1) m from the lower left corner.

    A: (2 - 1 + 4, 3 + 1) = (5, 4) m, so column 125, row 300 - 100. s1: (4, 2) m, so column 100, row 250.
    """
    picture_T_world, picture = fit_picture(
        estimate, drawn({"A": (125.0, 200.0), "s1": (100.0, 250.0)})
    )
    np.testing.assert_allclose(picture_T_world.vector, [6.0, 1.0, np.pi / 2], atol=1e-12)
    # Two pixels a cell of 4 cm each; 400 pixels are 16 m.
    assert picture.resolution == pytest.approx(0.08)
    assert picture.occupancy.shape[1] * picture.resolution == pytest.approx(16.0)
    assert picture.origin == (0.0, 0.0)
    # B, at (0, 5), is where the picture has it: (2 - 5 + 4, 0 + 1).
    np.testing.assert_allclose(picture_T_world.transform([0.0, 5.0]), [1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ({"A": (1.0, 1.0)}, "two points are needed"),
        ({"A": (1.0, 1.0), "s1": (1.0, 1.0)}, "coincide"),
        ({"A": (1.0, 1.0), "s9": (5.0, 1.0)}, "s9 has no place"),
    ],
)
def test_a_picture_that_fixes_no_frame_is_refused(estimate, points, message):
    with pytest.raises(SlamUwbError, match=message):
        fit_picture(estimate, drawn(points))


def test_a_third_point_that_does_not_fit_is_told(estimate):
    """B marked a metre (25 pixels) off: least squares leave a part of it at every point."""
    right = {"A": (125.0, 200.0), "s1": (100.0, 250.0), "B": (25.0, 275.0)}
    for points, count in ((right, 0), ({**right, "B": (50.0, 275.0)}, 1)):
        picture_T_world, picture = fit_picture(estimate, drawn(points))
        aligned = change_frame(estimate, picture_T_world)
        told = list(misfits(aligned, drawn(points), picture))
        assert len(told) >= count
        assert bool(told) == bool(count)
        assert not told or "from where it was given" in told[0]


def test_places_that_do_not_fit_are_told(estimate):
    """Two places 2 m further apart than the solution has them: 1 m off each."""
    a, s = np.array([3.0, 1.0]), np.array([1.0, 2.0])
    away = (a - s) / np.linalg.norm(a - s)
    known = {"A": tuple(a + away), "s1": tuple(s - away)}
    aligned = change_frame(estimate, fit_frame(estimate, known))
    assert [text.split(": ")[1] for text in misfits(aligned, known, None)] == [
        "A is 1.00 m from where it was given",
        "s1 is 1.00 m from where it was given",
    ]
    assert not list(misfits(aligned, "walls", None))
    assert not list(misfits(aligned, None, None))
