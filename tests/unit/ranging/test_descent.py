from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.ranging.descent import descend


class Counted:
    """A function that knows how often it was asked."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, place):
        self.calls += 1
        return float(self.function(place))


@pytest.mark.parametrize("scale", [1.0, 30.0, 300.0])
def test_the_minimum_of_a_quadratic_is_found_however_steep(scale):
    centre = np.array([0.7, -1.2, 0.4])
    hessian = np.diag([1.0, scale, 2.0]) + 0.3
    cost = Counted(lambda z: 0.5 * (z - centre) @ hessian @ (z - centre) + 5.0)

    place, least = descend(cost, np.zeros(3), 3.0)

    # Forward differences of 1e-4 put the minimum off by half of that.
    np.testing.assert_allclose(place, centre - 0.5e-4, atol=2e-4)
    assert least == pytest.approx(5.0, abs=1e-6)
    assert cost.calls < 100


def test_a_bend_ends_the_search_soon():
    # Least at the bend, z = (0.3, 0.5): slopes of 1 to either side of the first.
    cost = Counted(lambda z: abs(z[0] - 0.3) + 0.5 * (z[1] - 0.5) ** 2)

    place, _ = descend(cost, np.array([-1.0, 0.0]), 3.0)

    np.testing.assert_allclose(place, [0.3, 0.5], atol=0.02)
    assert cost.calls < 150


def test_no_parameter_leaves_the_bound():
    asked = []

    def cost(place):
        asked.append(np.abs(place).max())
        return float(0.5 * (place[0] - 9.0) ** 2 + 0.5 * (place[1] + 1.0) ** 2)

    place, _ = descend(cost, np.zeros(2), 3.0)

    np.testing.assert_allclose(place, [3.0, -1.0], atol=1e-3)
    assert max(asked) < 3.0 + 2e-4


def test_a_start_at_the_minimum_stays():
    place, least = descend(lambda z: float(z @ z), np.zeros(4), 3.0)

    assert np.abs(place).max() < 1e-3
    assert least < 1e-6
