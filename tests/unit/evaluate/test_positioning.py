"""Errors of located tags by hand."""

import math

import numpy as np
import pytest

from slam_uwb.evaluate import distances_to_path, static_errors, trajectory_errors
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.tag import TagTruth
from slam_uwb.positioning import PlaceEstimate, Track


def test_distances_to_a_path_by_hand():
    # Along x from 0 to 4, then up to (4, 3). (2, 1) is 1 over the first leg; (5, 1) is 1 beside the second;
    # (-3, 4) is 5 from the start; (4, 0) is on the corner; (6, 5) is 2 sqrt 2 from the end.
    path = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    points = np.array([[2.0, 1.0], [5.0, 1.0], [-3.0, 4.0], [4.0, 0.0], [6.0, 5.0]])
    np.testing.assert_allclose(
        distances_to_path(points, path), [1.0, 1.0, 5.0, 0.0, math.sqrt(8.0)], atol=1e-12
    )


def test_a_path_that_rests_or_is_one_point():
    rest = np.array([[1.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    np.testing.assert_allclose(distances_to_path(np.array([[1.0, 3.0]]), rest), [2.0])
    np.testing.assert_allclose(distances_to_path(np.array([[4.0, 5.0]]), rest[:1]), [5.0])


def test_static_errors_in_another_frame_by_hand():
    # The anchors' frame is turned by 90 degrees and moved by (1, 0): (2, 0) there is (1, 2) in the reference.
    pose = Pose2(1.0, 0.0, math.pi / 2)
    found = [
        PlaceEstimate("a", np.array([2.0, 0.0]), np.eye(2), 3),
        PlaceEstimate("b", None, None, 0),
        PlaceEstimate("unknown", np.zeros(2), np.eye(2), 3),
    ]
    truth = TagTruth({"a": np.array([1.0, 2.5]), "b": np.zeros(2)})
    errors = static_errors(found, truth, pose)
    assert errors["a"] == pytest.approx(0.5)
    assert math.isnan(errors["b"])
    assert set(errors) == {"a", "b"}


def test_trajectory_errors_keep_what_was_not_found():
    states = np.array([[np.nan] * 4, [1.0, 2.0, 0.0, 0.0]])
    track = Track(np.arange(2.0), states, np.zeros((2, 4, 4)), np.array([0, 1]))
    path = np.array([[0.0, 0.0], [9.0, 0.0]])
    errors = trajectory_errors(track, path)
    assert math.isnan(errors[0])
    assert errors[1] == pytest.approx(2.0)
    moved = trajectory_errors(track, path, Pose2(0.0, 1.0, 0.0))
    assert moved[1] == pytest.approx(3.0)
