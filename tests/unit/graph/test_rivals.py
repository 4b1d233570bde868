from __future__ import annotations

import math

import numpy as np
import pytest

from slam_uwb.graph.range_fit import RangeFit
from slam_uwb.graph.rivals import excluding_gaps
from slam_uwb.model.settings import GraphSettings

SETTINGS = GraphSettings(mirror_cost_gap=3.0, fault_cost_gap=8.0, anchor_inflation=1.44)
SIGMA_M = 0.1


def minima(*places) -> RangeFit:
    """The first is known to 0.1 m along x, to 0.2 m along y."""
    count = len(places)
    block = np.diag([SIGMA_M**-2, (2 * SIGMA_M) ** -2, 100.0])
    return RangeFit(
        np.array(places),
        np.zeros(count),
        0.0,
        np.arange(float(count)),
        np.tile(block, (count, 1, 1)),
    )


def gaps(places, faults):
    return excluding_gaps(minima(*places), np.array(faults), SETTINGS)


def test_a_rival_with_one_certain_fault_has_the_larger_gap():
    # 3 + ln(1 + (e^5 - 1) 1) = 8.
    found = gaps([(0, 0), (2, 0)], [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0)])

    np.testing.assert_allclose(found, (3.0, 8.0))


def test_a_range_that_may_be_a_fault_helps_as_far_as_it_may():
    # ln(1 + 147.41 x 0.01) = 0.906 nats.
    found = gaps([(0, 0), (2, 0)], [(0.0, 0.0), (0.01, 0.0)])

    assert found[1] == pytest.approx(3.0 + math.log1p(math.expm1(5.0) * 0.01))


def test_a_fault_at_both_places_helps_neither():
    found = gaps([(0, 0), (2, 0)], [(1.0, 0.0), (1.0, 0.0)])

    np.testing.assert_allclose(found, (3.0, 3.0))


def test_two_more_faults_are_not_one():
    found = gaps([(0, 0), (2, 0)], [(0.0, 0.0, 1.0), (0.9, 0.9, 1.0)])

    np.testing.assert_allclose(found, (3.0, 3.0))


def test_what_the_covariance_covers_is_no_rival():
    # Stated are 1.2 times 0.1 m along x and 0.2 m along y: five sigmas are 0.6 and 1.2 m.
    faults = [(0.0, 0.0), (1.0, 0.0)]

    assert gaps([(0, 0), (0.59, 0)], faults)[1] == pytest.approx(3.0)
    assert gaps([(0, 0), (0.61, 0)], faults)[1] == pytest.approx(8.0)
    assert gaps([(0, 0), (0, 1.19)], faults)[1] == pytest.approx(3.0)
    assert gaps([(0, 0), (0, 1.21)], faults)[1] == pytest.approx(8.0)


def test_one_place_has_no_rival():
    np.testing.assert_allclose(gaps([(1, 2)], [(1.0, 0.0)]), [3.0])
