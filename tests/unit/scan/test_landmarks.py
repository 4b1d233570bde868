import math

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.scan import prepare_scan
from slam_uwb.scan.landmarks import extract_landmarks

L_ROOM = [(0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)]


def assert_same_points(found, expected, tolerance=1e-9):
    assert len(found) == len(expected)
    apart = np.linalg.norm(found[:, None] - np.asarray(expected, dtype=float)[None], axis=2)
    assert apart.min(axis=0).max() < tolerance
    assert apart.min(axis=1).max() < tolerance


@pytest.mark.parametrize("theta", [0.0, 0.7, math.pi / 2, 3.1])
def test_corners_and_virtual_corners_of_a_known_room(polygon, observe, settings, theta):
    # Walls x = 0, 4, 6 and y = 0, 3, 4.5 meet in nine places: six corners, and the virtual
    # (4, 0), (0, 3), (6, 4.5).
    pose = Pose2(2.6, 2.1, theta)
    landmarks = prepare_scan("s", observe(polygon(*L_ROOM), pose), settings).landmarks
    expected = [(x, y) for x in (0, 4, 6) for y in (0, 3, 4.5)]
    assert_same_points(pose.transform(landmarks), expected)


def test_two_walls_meet_where_their_lines_meet(settings):
    # y = 1 and the diagonal x = y meet at (1, 1), although neither wall reaches there.
    segments = np.array([[(3, 1), (5, 1)], [(2, 2), (3, 3)]], dtype=float)
    assert_same_points(extract_landmarks(segments, settings), [(1, 1)])


def test_the_direction_of_a_segment_does_not_matter(settings):
    segments = np.array([[(3, 1), (5, 1)], [(2, 2), (3, 3)], [(0, 4), (1, 9)]], dtype=float)
    turned = segments[:, ::-1]
    assert_same_points(extract_landmarks(turned, settings), extract_landmarks(segments, settings))


@pytest.mark.parametrize(("degrees", "count"), [(0.0, 0), (19.0, 0), (21.0, 1), (90.0, 1)])
def test_flat_intersections_are_left_out(settings, degrees, count):
    a = math.radians(degrees)
    segments = np.array([[(-1, 0), (1, 0)], [(0, 1), (math.cos(a), 1 + math.sin(a))]])
    assert len(extract_landmarks(segments, settings)) == count


@pytest.mark.parametrize(("distance", "count"), [(24.9, 1), (25.1, 0)])
def test_far_intersections_are_left_out(settings, distance, count):
    segments = np.array([[(distance, 1), (distance, 2)], [(1, 0), (2, 0)]])
    assert len(extract_landmarks(segments, settings)) == count


def test_intersections_close_together_are_one_landmark_at_their_centre(settings):
    # Two walls 0.1 m apart cross the line y = 0 at x = 2.0 and 2.1.
    segments = np.array([[(2, 1), (2, 2)], [(2.1, 1), (2.1, 2)], [(0, 0), (1, 0)]], dtype=float)
    assert_same_points(extract_landmarks(segments, settings), [(2.05, 0.0)])


def test_intersections_further_apart_than_the_cluster_stay_two(settings):
    segments = np.array([[(2, 1), (2, 2)], [(2.5, 1), (2.5, 2)], [(0, 0), (1, 0)]], dtype=float)
    assert_same_points(extract_landmarks(segments, settings), [(2.0, 0.0), (2.5, 0.0)])


def test_a_cluster_is_no_chain(settings):
    """Places 0.2 m apart in a row of 2 m are not one landmark, though each is near to the next."""
    uprights = np.array([[(x, 1), (x, 2)] for x in np.arange(2.0, 4.01, 0.2)])
    segments = np.concatenate([uprights, [[(0, 0), (1, 0)]]])
    landmarks = extract_landmarks(segments, settings)
    assert 3 <= len(landmarks) <= 8


def test_landmarks_are_ordered_by_bearing(settings):
    rng = np.random.default_rng(3)
    landmarks = extract_landmarks(rng.uniform(-8, 8, (12, 2, 2)), settings)
    assert len(landmarks) > 10
    assert (np.diff(np.arctan2(*landmarks.T[::-1])) >= 0).all()


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_walls_meet_nowhere(settings, count):
    segments = np.array([[(0, 1), (2, 1)]], dtype=float)[:count]
    assert extract_landmarks(segments, settings).shape == (0, 2)
