from __future__ import annotations

import math

import gtsam
import numpy as np
import pytest

from slam_uwb.graph import factors
from slam_uwb.model.errors import SolverError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import ScanMatch
from slam_uwb.model.survey import KnownPlace, RangeOffset

X0, X1, L0, L1, B = factors.X(0), factors.X(1), factors.L(0), factors.L(1), factors.OFFSET_KEY
D0 = factors.D(0)
WIDTHS = {X0: 3, L0: 2, L1: 2, B: 1, D0: 1}


def values(pose=(0.0, 0.0, 0.0), point=(3.0, 4.0), offset=0.0, other=(0.0, 0.0)):
    result = gtsam.Values()
    result.insert(X0, gtsam.Pose2(*pose))
    result.insert(L0, np.array(point))
    result.insert(L1, np.array(other))
    result.insert(B, offset)
    result.insert(D0, offset)
    return result


def slant(measured=0.0, sigma=1.0, lever=(0.0, 0.0), rise=0.0):
    return factors.slant_range_factor(0, 0, measured, sigma, np.array(lever), rise)


def residual(factor, at) -> np.ndarray:
    return factor.unwhitenedError(at)


def test_the_slant_range_by_hand():
    # Horizontal 3, 4 -> 5; rise 12 -> 13; offset 0.2; measured 13.5: predicted - measured = -0.3.
    factor = slant(measured=13.5, rise=12.0)

    assert residual(factor, values(offset=0.2)) == pytest.approx([-0.3])


def test_the_lever_arm_turns_with_the_scanner():
    # Heading 90 degrees: (1, 0) in the scanner's frame is (0, 1) in the world; tag at (1, 3).
    # The anchor at (4, 7) is 3, 4 away: 5.
    factor = slant(lever=(1.0, 0.0))

    at = values(pose=(1.0, 2.0, math.pi / 2), point=(4.0, 7.0))
    assert residual(factor, at) == pytest.approx([5.0])


def numeric_jacobians(factor, at) -> list[np.ndarray]:
    """Central differences in the tangent space of every variable, in the factor's order of keys."""
    columns = []
    for key in list(factor.keys()):
        size = WIDTHS[key]
        column = np.zeros((1, size))
        for axis in range(size):
            sides = []
            for step in (1e-6, -1e-6):
                delta = gtsam.VectorValues()
                for other in list(at.keys()):
                    width = WIDTHS[other]
                    change = np.zeros(width)
                    change[axis if other == key else 0] = step if other == key else 0.0
                    delta.insert(other, change)
                sides.append(residual(factor, at.retract(delta))[0])
            column[0, axis] = (sides[0] - sides[1]) / 2e-6
        columns.append(column)
    return columns


def analytic_jacobians(factor, at) -> list[np.ndarray]:
    # Sigma is 1, so whitening changes nothing; Jacobian factors keep the order of keys.
    matrix = factor.linearize(at).jacobian()[0]
    ends = np.cumsum([WIDTHS[key] for key in list(factor.keys())])
    return np.split(matrix, ends[:-1], axis=1)


@pytest.mark.parametrize("seed", range(10))
def test_derivatives_of_the_slant_range_are_those_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    factor = slant(7.0, 1.0, rng.uniform(-0.5, 0.5, 2), rng.uniform(-2, 2))
    at = values((*rng.uniform(-5, 5, 2), rng.uniform(-3, 3)), rng.uniform(-5, 5, 2), 0.1)

    for exact, numeric in zip(
        analytic_jacobians(factor, at), numeric_jacobians(factor, at), strict=True
    ):
        np.testing.assert_allclose(exact, numeric, atol=1e-7)


def test_derivatives_of_the_anchor_range_are_those_of_finite_differences():
    factor = factors.anchor_range_factor(0, 1, 7.0, 1.0, rise=0.7)
    at = values(point=(3.0, -1.0), other=(-2.0, 4.0), offset=0.1)

    # By hand: sqrt(5^2 + 5^2 + 0.7^2) + 0.1 - 7.
    assert residual(factor, at) == pytest.approx([math.sqrt(50.49) - 6.9])
    for exact, numeric in zip(
        analytic_jacobians(factor, at), numeric_jacobians(factor, at), strict=True
    ):
        np.testing.assert_allclose(exact, numeric, atol=1e-7)


def test_straight_below_the_anchor_everything_is_finite():
    at = values(pose=(3.0, 4.0, 0.5))

    for rise in (0.0, 1.2):
        factor = slant(measured=1.0, rise=rise)
        assert residual(factor, at) == pytest.approx([rise - 1.0])
        assert all(np.isfinite(block).all() for block in analytic_jacobians(factor, at))


def test_the_sigma_of_a_range_whitens_it():
    factor = slant(measured=4.0, sigma=0.5)

    # Residual 5 - 4 = 1 is 2 sigmas: half of 2^2.
    assert factor.error(values()) == pytest.approx(2.0)


def test_a_match_is_weighed_in_the_axes_of_its_source():
    # The source is turned by 90 degrees and 1 cm off along the world's x: its own -y axis, where
    # sigma is 1 cm, one sigma. In the target's axes it would be 1 cm along x, a tenth of a sigma.
    match = ScanMatch(
        "a", "b", Pose2(2.0, 0.0, math.pi / 2), np.diag([0.1**2, 0.01**2, 0.01**2]), 1, 0, 1, 0
    )
    factor = factors.match_factor(match, 0, 1)
    at = gtsam.Values()
    at.insert(X0, gtsam.Pose2(0, 0, 0))
    at.insert(X1, gtsam.Pose2(2.01, 0.0, math.pi / 2))

    assert factor.error(at) == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize(
    "covariance",
    [
        np.diag([1.0, 1.0, 0.0]),
        np.diag([1.0, -1.0, 1.0]),
        np.diag([1.0, 1.0, math.nan]),
        np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ],
)
def test_a_covariance_that_gtsam_would_take_silently_is_refused(covariance):
    with pytest.raises(SolverError, match="covariance of match a - b"):
        factors.match_factor(ScanMatch("a", "b", Pose2.identity(), covariance, 1, 0, 1, 0), 0, 1)


def test_millimetres_beside_radians_are_no_singular_covariance():
    noise = factors.covariance_noise(np.diag([1e-6, 1e4, 1e-8]), "a corridor")
    np.testing.assert_allclose(noise.covariance(), np.diag([1e-6, 1e4, 1e-8]), rtol=1e-9)


def test_a_known_station_is_held_in_the_world_s_axes():
    at = values(pose=(1.02, 2.0, math.pi / 2))

    graph = gtsam.NonlinearFactorGraph()
    for factor in factors.known_station_factors(0, KnownPlace(1.0, 2.0, 0.02, math.pi / 2, 0.01)):
        graph.push_back(factor)

    # 2 cm at 2 cm: half of 1; the heading is right.
    assert graph.error(at) == pytest.approx(0.5)
    assert graph.size() == 2
    assert len(factors.known_station_factors(0, KnownPlace(1.0, 2.0))) == 1


def test_priors_of_heading_and_offset():
    assert factors.heading_factor(0, 0.3, 0.1).error(values(pose=(5, 5, 0.5))) == pytest.approx(2.0)
    prior = factors.offset_prior(RangeOffset(0.18, 0.10))
    assert prior.error(values(offset=0.28)) == pytest.approx(0.5)
