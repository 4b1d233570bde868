from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.graph.losses import one_sided_cost, one_sided_curvature, one_sided_weight

RESIDUALS = np.array([-2.0, -0.3, 0.0, 0.05, 0.4, 3.0])


def test_costs_by_hand():
    # Short by 2 sigmas: 2^2 / 2. Long by 2 sigmas with scale 1: ln(1 + 4) / 2.
    costs = one_sided_cost(np.array([-0.2, 0.2]), np.array([0.1, 0.1]), 1.0)

    assert costs == pytest.approx([2.0, 0.804719], abs=1e-6)


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_weight_and_curvature_are_the_derivatives_of_the_cost(scale):
    sigma, step = 0.2, 1e-5

    def cost(residuals):
        return one_sided_cost(residuals, sigma, scale)

    away = RESIDUALS[RESIDUALS != 0.0]
    slope = (cost(away + step) - cost(away - step)) / (2 * step)
    bend = (cost(away + step) - 2 * cost(away) + cost(away - step)) / step**2
    np.testing.assert_allclose(
        one_sided_weight(away, sigma, scale) * away / sigma**2, slope, rtol=1e-6
    )
    np.testing.assert_allclose(
        one_sided_curvature(away, sigma, scale) / sigma**2, bend, rtol=1e-3, atol=1e-3
    )


def test_only_long_ranges_lose_weight():
    weights = one_sided_weight(RESIDUALS, 0.1, 1.0)

    assert (weights[RESIDUALS <= 0.0] == 1.0).all()
    assert (np.diff(weights[RESIDUALS >= 0.0]) < 0.0).all()
