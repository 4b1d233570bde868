import math

import numpy as np

from slam_uwb.matching.batch import distinct


def test_distinct_keeps_the_best_of_each_place_in_order():
    poses = np.array([[0, 0, 0], [0.1, 0, 0], [2, 0, 0], [0, 0, 0.5], [2, 0.1, 0.01]], dtype=float)
    assert distinct(poses, np.array([1.0, 3.0, 2.0, 0.5, 4.0]), 10) == [4, 1, 3]


def test_distinct_stops_at_the_count_wanted():
    poses = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
    assert distinct(poses, np.arange(6.0), 2) == [5, 4]


def test_headings_on_both_sides_of_the_seam_are_near():
    poses = np.array([[0, 0, math.pi - 0.01], [0, 0, -math.pi + 0.01], [0, 0, 5 * math.pi]])
    assert distinct(poses, np.array([1.0, 2.0, 0.0]), 10) == [1]


def test_of_equals_the_first_is_kept():
    assert distinct(np.zeros((3, 3)), np.ones(3), 3) == [0]


def test_nothing_is_distinct_in_nothing():
    assert distinct(np.zeros((0, 3)), np.zeros(0), 5) == []
