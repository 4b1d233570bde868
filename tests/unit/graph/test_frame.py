from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.graph.frame import (
    SITE,
    Start,
    alignment_covariance,
    choose_start,
    rigid_fit,
    tie_to_site,
)
from slam_uwb.model.errors import DisconnectedSurveyError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import GraphProblem, ScanMatch
from slam_uwb.model.survey import Anchor, KnownPlace, Station

SITE_T_A = Pose2(10.0, -4.0, 0.8)
TRUTH = {"a": SITE_T_A, "b": SITE_T_A @ Pose2(3.0, 0.0, 1.0), "c": SITE_T_A @ Pose2(1.0, 4.0, 0.0)}


def match(target, source) -> ScanMatch:
    pose = TRUTH[target].inverse() @ TRUTH[source]
    return ScanMatch(target, source, pose, 1e-4 * np.eye(3), 0.5, 0.0, 1.0, 0)


def problem(known=None, anchors=(), grouped="abc", extra=()) -> GraphProblem:
    known = known or {}
    names = [*TRUTH, *extra]
    return GraphProblem(
        stations=tuple(Station(name, None, 1.4, known.get(name)) for name in names),
        anchors=tuple(anchors),
        matches=tuple(match(grouped[0], other) for other in grouped[1:]),
        # In any frame; the start is in that of the first station.
        placement={name: Pose2(5.0, 5.0, 2.0) @ TRUTH[name] for name in grouped},
        links=(),
    )


def at(name, theta=None) -> KnownPlace:
    return KnownPlace(TRUTH[name].x, TRUTH[name].y, theta=theta)


def assert_site(start: Start) -> None:
    assert start.frame == SITE
    for name, pose in TRUTH.items():
        assert pose.distance_to(start.poses[name]) < 1e-9
        assert pose.angle_to(start.poses[name]) < 1e-9


def test_without_control_points_the_first_station_is_the_frame():
    start = choose_start(problem())

    assert (start.frame, start.gauge) == ("a", "a")
    assert start.poses["a"].vector == pytest.approx([0.0, 0.0, 0.0])
    assert start.poses["b"].vector == pytest.approx([3.0, 0.0, 1.0])


def test_two_control_points_move_the_group_onto_the_site():
    assert_site(choose_start(problem({"a": at("a"), "c": at("c")})))


def test_one_control_point_with_yaw_is_enough():
    assert_site(choose_start(problem({"b": at("b", TRUTH["b"].theta)})))


def test_one_control_point_without_yaw_is_not():
    assert choose_start(problem({"b": at("b")})).frame == "a"


def test_two_control_points_in_one_place_give_no_direction():
    near = KnownPlace(TRUTH["a"].x + 0.01, TRUTH["a"].y)

    assert choose_start(problem({"a": at("a"), "b": near})).frame == "a"


def test_known_stations_outside_the_group_join_the_site():
    known = {
        "a": at("a"),
        "b": at("b"),
        "x": KnownPlace(1.0, 2.0),
        "y": KnownPlace(3.0, 2.0, theta=0.5),
    }

    start = choose_start(problem(known, extra=("x", "y")))

    assert start.poses["x"].vector == pytest.approx([1.0, 2.0, 0.0])
    assert start.poses["y"].vector == pytest.approx([3.0, 2.0, 0.5])
    assert start.headings == {"a", "b", "c", "y"}
    assert start.group == {"a", "b", "c"}


def test_of_a_group_and_known_stations_the_larger_is_solved():
    known = {name: KnownPlace(k, 0.0) for k, name in enumerate("wxyz")}

    many = choose_start(problem(known, extra="wxyz"))
    few = choose_start(problem({k: known[k] for k in "wx"}, extra="wx"))

    assert (many.frame, set(many.poses)) == (SITE, set("wxyz"))
    assert (few.frame, set(few.poses)) == ("a", set("abc"))


def test_nothing_that_holds_together_is_an_error():
    with pytest.raises(DisconnectedSurveyError):
        choose_start(problem({"a": at("a")}, grouped="a"))


def test_anchors_tie_the_group_to_the_site():
    anchors = [
        Anchor("A", 2.5, KnownPlace(*SITE_T_A.transform([2.0, 2.0]))),
        Anchor("B", 2.5, KnownPlace(*SITE_T_A.transform([-3.0, 1.0]))),
    ]
    tied = problem(anchors=anchors)
    start = choose_start(tied)
    places = {"A": np.array([2.0, 2.0]), "B": np.array([-3.0, 1.0])}

    site = tie_to_site(tied, start, {}, places)

    assert_site(site)
    # Until anchors are in the graph something has to hold it.
    assert site.gauge == "a"
    assert tie_to_site(tied, start, {}, {"A": places["A"]}) is None
    assert tie_to_site(tied, site, {}, places) is None


def test_a_rigid_fit_neither_scales_nor_mirrors():
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    pose = Pose2(1.0, 2.0, 2.5)

    assert rigid_fit(points, pose.transform(points)).vector == pytest.approx(pose.vector)
    fitted = rigid_fit(points, 3.0 * points * [1.0, -1.0])
    assert np.linalg.det(fitted.rotation) == pytest.approx(1.0)


def test_the_covariance_of_an_alignment_by_hand():
    # Two points 1 m either side of the root, each 2 cm on both axes: place 2 cm / sqrt(2); the
    # heading 2 cm sqrt(2) over 2 m.
    start = Start(SITE, {"a": Pose2(0.0, 0.0, 0.4)}, frozenset("a"), frozenset("a"), None)
    controls = [(start.poses["a"].transform([x, 0.0]), KnownPlace(0.0, 0.0, 0.02)) for x in (-1, 1)]

    covariance = alignment_covariance(start, "a", controls)

    expected = np.diag([0.0002, 0.0002, 0.0002])
    np.testing.assert_allclose(covariance, expected, atol=1e-7)
