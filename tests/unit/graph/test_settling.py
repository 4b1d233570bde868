import numpy as np

from slam_uwb.graph.settling import Labels, next_labels


def iterate(function, start, rounds):
    labels = Labels(start)
    for _ in range(rounds):
        labels = next_labels(function(labels.used), labels)
    return labels.used


def pull(slope, fixed):
    """Labels that follow their own last value by `slope` about a fixed point."""
    return lambda labels: fixed + slope * (labels - fixed)


def test_slow_approach_is_cut_short():
    """Slope 0.9: half-way steps close 5 % a round and would need 270 for 1e-6."""
    fixed, start = np.array([[0.3, 0.7], [0.6, 0.4]]), np.array([[0.9, 0.1], [0.5, 0.5]])
    np.testing.assert_allclose(iterate(pull(0.9, fixed), start, 4), fixed, atol=1e-6)


def test_labels_that_swing_come_to_rest():
    """Slope -1: taken as told they would swing between two values for ever."""
    fixed, start = np.array([[0.3, 0.7]]), np.array([[0.6, 0.4]])
    np.testing.assert_allclose(iterate(pull(-1.0, fixed), start, 4), fixed, atol=1e-6)


def test_labels_stay_probabilities():
    rng = np.random.default_rng(0)
    labels = None
    for _ in range(30):
        told = rng.dirichlet(np.ones(5), 8)
        labels = next_labels(told, labels)
        assert (labels.used >= 0.0).all()
        np.testing.assert_allclose(labels.used.sum(axis=1), 1.0)


def test_other_ranges_and_unknown_walls_start_anew():
    before = next_labels(np.array([[0.5, 0.5]]), None)
    told = np.array([[0.2, 0.8], [0.1, 0.9]])
    np.testing.assert_array_equal(next_labels(told, before).used, told)
    unknown = np.full((1, 2), np.nan)
    np.testing.assert_array_equal(next_labels(unknown, before).used, unknown)
