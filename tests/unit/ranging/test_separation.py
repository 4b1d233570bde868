import numpy as np
import pytest

from slam_uwb.model.products import LinkMeasurement
from slam_uwb.ranging import least_separation


def link(station, anchor, distance, rejection=None):
    return LinkMeasurement(station, anchor, distance, distance, 0.1, 10, rejection=rejection)


def test_the_second_largest_difference_to_common_anchors_counts():
    # Differences 3.0, 1.5 and 0.5 m; a fault of one link makes one of them large, not two.
    links = [
        link("s1", "A", 5.0), link("s1", "B", 4.0), link("s1", "C", 6.0),
        link("s2", "A", 8.0), link("s2", "B", 5.5), link("s2", "C", 5.5),
    ]  # fmt: skip
    np.testing.assert_allclose(least_separation(("s1", "s2"), links), [[0.0, 1.5], [1.5, 0.0]])


def test_stations_that_hear_no_anchor_in_common_are_apart_and_of_deaf_ones_nothing_is_known():
    links = [link("s1", "A", 5.0), link("s2", "B", 5.0), link("s3", "A", 2.0, "absurd")]
    separation = least_separation(("s1", "s2", "s3"), links)
    assert separation[0, 1] == np.inf
    assert separation[0, 2] == separation[2, 1] == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_without_errors_it_never_exceeds_the_distance(seed):
    rng = np.random.default_rng(seed)
    stations, anchors = rng.uniform(0.0, 50.0, (90, 2)), rng.uniform(0.0, 50.0, (12, 2))
    names = [f"s{k}" for k in range(90)]
    links = [
        link(names[k], f"A{j}", float(np.hypot(*(stations[k] - anchors[j]))))
        for k in range(90)
        for j in range(12)
    ]
    apart = np.hypot(*(stations[:, None] - stations).transpose(2, 0, 1))
    separation = least_separation(names, links)
    assert (separation <= apart + 1e-9).all()
    assert separation[np.triu_indices(90, 1)].mean() > 10.0
    np.testing.assert_array_equal(separation, separation.T)
