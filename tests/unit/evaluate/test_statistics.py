"""Distributions, intervals and paired comparisons against answers derived by hand."""

import math

import numpy as np
import pytest

from slam_uwb.evaluate import (
    bootstrap_interval,
    ecdf,
    nees_bounds,
    pooled_nees,
    sign_flip_test,
)

NAN = math.nan


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_ecdf_by_hand():
    # Of 0.3, 0.1 and 0.2 one third is at most 0.1, two thirds at most 0.2, all at most 0.3.
    values, shares = ecdf([0.3, NAN, 0.1, 0.2])
    np.testing.assert_array_equal(values, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(shares, [1 / 3, 2 / 3, 1.0])


def test_ecdf_of_nothing_is_empty():
    values, shares = ecdf([NAN])
    assert len(values) == len(shares) == 0


def test_interval_of_equal_values_is_a_point(rng):
    interval = bootstrap_interval([0.3, 0.3, 0.3, NAN], rng)
    assert (interval.value, interval.low, interval.high, interval.count) == (0.3, 0.3, 0.3, 3)


def test_interval_of_a_mean_is_that_of_the_normal_law(rng):
    # The mean of 400 values has the standard deviation s / 20; 95 % of a normal lie within 1.96 of them.
    values = rng.normal(2.0, 3.0, 400)
    interval = bootstrap_interval(values, rng, statistic=np.mean, draws=4000)
    half = 1.96 * np.std(values) / 20.0
    assert interval.value == pytest.approx(np.mean(values))
    assert interval.low == pytest.approx(np.mean(values) - half, abs=0.1 * half)
    assert interval.high == pytest.approx(np.mean(values) + half, abs=0.1 * half)


def test_interval_covers_as_often_as_it_says(rng):
    # Medians of 40 exponential values; the true median is ln 2. Percentile intervals cover a little less
    # than they say; 200 trials scatter by 0.02.
    covered = [
        (i := bootstrap_interval(rng.exponential(1.0, 40), rng, draws=400)).low
        <= math.log(2.0)
        <= i.high
        for _ in range(200)
    ]
    assert 0.88 <= np.mean(covered) <= 0.99


def test_one_value_has_no_interval_and_none_has_nothing(rng):
    one = bootstrap_interval([0.2], rng)
    assert (one.value, one.count) == (0.2, 1)
    assert math.isnan(one.low)
    assert math.isnan(bootstrap_interval([], rng).value)


def test_the_same_generator_gives_the_same_interval():
    values = np.arange(9.0)
    first, second = (bootstrap_interval(values, np.random.default_rng(1)) for _ in range(2))
    assert first == second


def test_sign_flips_by_hand(rng):
    # Differences -1, -2, -3: of the 8 ways to sign 1, 2, 3, only +++ and --- have a mean as large: 2 / 8.
    found = sign_flip_test([1.0, 2.0, 3.0], [2.0, 4.0, 6.0], rng)
    assert (found.count, found.better) == (3, 3)
    assert found.mean_difference == found.median_difference == -2.0
    assert found.p_value == pytest.approx(0.25)


def test_sign_flips_of_unequal_pairs_by_hand(rng):
    # Differences 3, -1: |mean| of +3 +1, +3 -1, -3 +1, -3 -1 is 2, 1, 1, 2; all are at least the 1 found.
    found = sign_flip_test([3.0, 0.0], [0.0, 1.0], rng)
    assert found.p_value == pytest.approx(1.0)
    assert found.better == 1


def test_surveys_that_one_method_failed_are_left_out_and_counted(rng):
    found = sign_flip_test([1.0, NAN, 3.0], [2.0, 0.0, NAN], rng)
    assert (found.count, found.better) == (1, 1)
    assert found.p_value == 1.0
    assert math.isnan(sign_flip_test([NAN], [1.0], rng).p_value)


def test_a_real_difference_is_found_and_chance_is_not(rng):
    base = rng.normal(size=50)
    noise = rng.normal(size=50)
    assert sign_flip_test(base + 1.0 + 0.5 * noise, base, rng).p_value < 1e-3
    # Under chance p is uniform: about a tenth of many lie below 0.1.
    small = [
        sign_flip_test(rng.normal(size=20), np.zeros(20), rng, draws=199).p_value < 0.1
        for _ in range(150)
    ]
    assert 0.03 < np.mean(small) < 0.19


def test_unequal_lengths_are_refused(rng):
    with pytest.raises(ValueError, match="shapes"):
        sign_flip_test([1.0, 2.0], [1.0], rng)


def test_nees_by_hand():
    # 12 over 6 and 3 over 4 degrees of freedom: 15 over 10.
    assert pooled_nees([(12.0, 6), (3.0, 4), (0.0, 0)]) == 1.5
    assert math.isnan(pooled_nees([]))
    # Chi-square with 2 degrees of freedom is exponential of mean 2: quantile q at -2 ln(1 - q).
    low, high = nees_bounds(2)
    assert low == pytest.approx(-math.log(0.975))
    assert high == pytest.approx(-math.log(0.025))
    assert math.isnan(nees_bounds(0)[0])
