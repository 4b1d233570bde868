from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import gamma

from slam_uwb.ranging.density import (
    MAX_WALLS,
    ErrorParameters,
    LinkDensity,
    error_table,
    fault_density,
)

PARAMETERS = [
    ErrorParameters(),
    ErrorParameters(sight_sigma=0.06, wall_delay=0.1),
    ErrorParameters(sight_sigma=0.14, wall_delay=1.2, wall_shape=2.0),
]
GRID = np.arange(-7.999, 39.99, 0.005)


def mixture(parameters=PARAMETERS[0], walls=(0.3, 0.4, 0.2, 0.07, 0.03), weight=1.0):
    def density(errors):
        size = len(errors)
        return LinkDensity(
            error_table(parameters), np.tile(walls, (size, 1)), np.full(size, weight)
        )

    return density


@pytest.mark.parametrize("parameters", PARAMETERS)
def test_every_density_integrates_to_one_and_has_the_mean_of_its_walls(parameters):
    value = error_table(parameters).densities(GRID)

    np.testing.assert_allclose(value.sum(axis=0) * 0.005, 1.0, atol=2e-5)
    # n walls delay by n times the mean; reflections (0.3 m, a share of 0.08) by 2.4 cm.
    expected = np.arange(MAX_WALLS + 1) * parameters.wall_delay
    expected[0] = 0.3 * parameters.reflected_share
    np.testing.assert_allclose((value * GRID[:, None]).sum(axis=0) * 0.005, expected, atol=2e-3)


def test_faults_integrate_to_one_and_take_no_side():
    errors = np.linspace(-4000.0, 4000.0, 4_000_001)

    value, slope, _ = fault_density(errors, ErrorParameters())

    assert value.sum() * 0.002 == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(value, value[::-1], rtol=1e-9)
    np.testing.assert_allclose(slope, -slope[::-1], atol=1e-9)


def test_one_wall_is_a_gaussian_convolved_with_a_gamma_density():
    # The convolution as a sum: error e = delay + noise.
    parameters = ErrorParameters(sight_sigma=0.1, wall_delay=0.5, wall_shape=1.3)
    edges = np.linspace(0.0, 12.0, 60_001)
    delays, shares = (edges[1:] + edges[:-1]) / 2, np.diff(gamma.cdf(edges, 1.3, scale=0.5 / 1.3))
    errors = np.array([-0.2, 0.0, 0.1, 0.4, 1.0, 3.0])

    value = error_table(parameters).densities(errors)

    noise = np.exp(-0.5 * ((errors[:, None] - delays) / 0.1) ** 2) / (0.1 * math.sqrt(2 * math.pi))
    np.testing.assert_allclose(value[:, 1], noise @ shares, rtol=2e-4, atol=1e-6)


def test_walls_without_delay_are_line_of_sight():
    parameters = ErrorParameters(sight_sigma=0.1, wall_delay=1e-6, reflected_share=0.0)
    errors = np.linspace(-0.4, 0.4, 33)

    value = error_table(parameters).densities(errors)

    normal = np.exp(-0.5 * (errors / 0.1) ** 2) / (0.1 * math.sqrt(2 * math.pi))
    for column in value.T:
        np.testing.assert_allclose(column, normal, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("parameters", PARAMETERS)
def test_slope_and_curvature_are_the_derivatives_of_the_very_same_cost(parameters):
    # Mid-cell, so that the steps stay within one cubic: exact up to rounding.
    errors = np.array([-35.0, -3.005, -0.305, -0.005, 0.035, 0.215, 0.995, 4.015, 12.005, 60.0])
    step, density = 1e-4, mixture(parameters)

    cost, slope, curvature = density(errors).expand(errors)

    below, above = density(errors).costs(errors - step), density(errors).costs(errors + step)
    np.testing.assert_allclose(slope, (above - below) / (2 * step), rtol=1e-4, atol=1e-4)
    bend = (above - 2.0 * cost + below) / step**2
    np.testing.assert_allclose(curvature, bend, rtol=1e-3, atol=2e-3)


def test_no_cost_bends_more_than_that_of_line_of_sight():
    # Every density is a Gaussian convolved with something: EM steps with 1 / sigma^2 never overshoot.
    for walls in np.eye(MAX_WALLS + 1):
        _, _, curvature = mixture(walls=walls)(GRID).expand(GRID)
        assert curvature.max() <= 1.01 / 0.09**2


def test_links_that_share_an_error_count_less():
    errors = np.array([-0.1, 0.4])

    one, half = mixture()(errors), mixture(weight=0.5)(errors)

    for whole, part in zip(one.expand(errors), half.expand(errors), strict=True):
        np.testing.assert_allclose(part, 0.5 * whole)


def test_what_a_range_says_of_its_walls():
    errors = np.array([0.0, 1.2, -5.0, 30.0])

    walls, faults = mixture(walls=(0.5, 0.5, 0.0, 0.0, 0.0))(errors).posterior(errors)

    np.testing.assert_allclose(walls.sum(axis=1) + faults, 1.0)
    assert walls[0, 0] > 0.7
    assert walls[1, 1] > 0.9
    assert (faults[2:] > 0.999).all()
    assert (walls[:, 2:] == 0.0).all()
