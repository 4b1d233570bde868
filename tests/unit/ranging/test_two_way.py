from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.ranging import (
    asymmetric_bias,
    asymmetric_distances,
    symmetric_bias,
    symmetric_distances,
)

C = 299_792_458.0


def true_periods(distance: float, anchor_reply: float, tag_reply: float) -> np.ndarray:
    # Fig. 3 of the paper: a round trip is the other side's reply plus two flights.
    flight = distance / C
    return np.array([[anchor_reply + 2 * flight, anchor_reply, tag_reply, tag_reply + 2 * flight]])


def as_measured(periods: np.ndarray, tag_error: float, anchor_error: float) -> np.ndarray:
    # Eq. 1: the tag's clock measures T1 and T3, the anchor's T2 and T4.
    return periods * (1.0 + np.array([tag_error, anchor_error, tag_error, anchor_error]))


@pytest.mark.parametrize("formula", [symmetric_distances, asymmetric_distances])
@pytest.mark.parametrize("replies", [(1e-3, 1e-3), (3e-4, 2.1e-3)])
def test_perfect_clocks_give_the_true_distance(formula, replies):
    periods = np.vstack([true_periods(d, *replies) for d in (0.3, 7.25, 140.0)])

    np.testing.assert_allclose(formula(periods), [0.3, 7.25, 140.0], atol=1e-6)


def test_the_symmetric_formula_by_hand():
    # (T1 - T2 + T4 - T3) / 4 = (1010 - 1000 + 2030 - 2000) / 4 ns = 10 ns = 2.99792458 m.
    periods = np.array([[1010e-9, 1000e-9, 2000e-9, 2030e-9]])

    assert symmetric_distances(periods)[0] == pytest.approx(2.99792458, abs=1e-9)


def test_the_asymmetric_formula_by_hand():
    # (T1 T4 - T2 T3) / sum with 3, 1, 1, 3 s: (9 - 1) / 8 = 1 s.
    assert asymmetric_distances(np.array([[3.0, 1.0, 1.0, 3.0]]))[0] == pytest.approx(C)


def test_clock_errors_bias_the_symmetric_formula_as_equation_3_says():
    truth = true_periods(10.0, anchor_reply=1e-3, tag_reply=3e-3)
    measured = as_measured(truth, 1e-5, -5e-6)

    bias = symmetric_distances(measured) - 10.0

    # T1 - T3 = -2 ms, T4 - T2 = +2 ms: c (-2e-3 * 1e-5 + 2e-3 * -5e-6) / 4 = -2.248 m.
    assert bias[0] == pytest.approx(-C * 3e-8 / 4, abs=1e-3)
    np.testing.assert_allclose(bias, symmetric_bias(truth, 1e-5, -5e-6), atol=1e-9)


def test_equal_replies_cancel_the_clock_errors():
    truth = true_periods(10.0, 1e-3, 1e-3)

    # What is left is 2 flights * (1e-5 - 5e-6) / 4: 25 micrometres at 10 m.
    assert abs(symmetric_distances(as_measured(truth, 1e-5, -5e-6))[0] - 10.0) < 1e-4


def test_the_asymmetric_formula_does_not_care_about_unequal_replies():
    truth = true_periods(10.0, anchor_reply=1e-3, tag_reply=3e-3)
    measured = as_measured(truth, 1e-5, -4e-6)

    bias = asymmetric_distances(measured) - 10.0

    np.testing.assert_allclose(bias, asymmetric_bias(np.array([10.0]), 1e-5, -4e-6), atol=1e-7)
    assert abs(bias[0]) < 1e-4


def test_periods_without_sense_are_nan_not_an_error():
    assert np.isnan(asymmetric_distances(np.zeros((1, 4)))[0])
