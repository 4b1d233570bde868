"""What may be said of errors over many surveys: distributions, intervals, one method against another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from ..model.geometry import FloatArray

Statistic = Callable[..., Any]
"""A function of (..., N) values and `axis`, such as `numpy.median`."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A statistic with its bootstrap interval, in the unit of the values."""

    value: float
    low: float
    high: float
    count: int
    """How many values there were."""


@dataclass(frozen=True, slots=True)
class PairedComparison:
    """Two methods on the same surveys; differences are the first minus the second."""

    count: int
    """Surveys on which both have a value."""
    mean_difference: float
    median_difference: float
    better: int
    """Surveys on which the first has the smaller value."""
    p_value: float
    """Two-sided: how often signs thrown by a coin give a mean difference as large as this."""


def ecdf(errors: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Empirical cumulative distribution: the sorted values (N,) and the share (N,) that is no larger.

    NaN are left out; equal values appear once each, the last with the share that counts.
    """
    values = _known(errors)
    return np.sort(values), np.arange(1.0, len(values) + 1.0) / max(len(values), 1)


def bootstrap_interval(
    values: ArrayLike,
    rng: np.random.Generator,
    statistic: Statistic = np.median,
    level: float = 0.95,
    draws: int = 2000,
) -> Interval:
    """Percentile interval of a statistic over surveys (Efron 1979); NaN are left out.

    The interval is NaN for fewer than two values.

    Args:
        values: (N,) one a survey, so that they are independent.
        rng: For the resampling.
        statistic: What is quoted; the median by default.
        level: Confidence, 0-1.
        draws: Resamplings.
    """
    known = _known(values)
    if not len(known):
        return Interval(float("nan"), float("nan"), float("nan"), 0)
    value = float(statistic(known, axis=-1))
    if len(known) < 2:
        return Interval(value, float("nan"), float("nan"), len(known))
    drawn = known[rng.integers(0, len(known), (draws, len(known)))]
    tails = 0.5 * (1.0 + np.array([-level, level]))
    low, high = np.quantile(statistic(drawn, axis=-1), tails)
    return Interval(value, float(low), float(high), len(known))


def sign_flip_test(
    first: ArrayLike, second: ArrayLike, rng: np.random.Generator, draws: int = 9999
) -> PairedComparison:
    """Does one of two methods err less on the same surveys? Paired permutation test (Fisher 1935).

    If neither did, each difference could as well have the other sign. All signs are tried where
    they are no more than `draws` (13 surveys), random ones otherwise. Surveys on which one has no
    value (NaN) are left out, so look at `count` too.

    Args:
        first: (N,) of the first method, one a survey.
        second: (N,) of the second, in the same order.
        rng: For the random signs.
        draws: How many.

    Raises:
        ValueError: The lengths differ.
    """
    # Loading it takes as long as a small survey's report, which needs none of it.
    from scipy.stats import permutation_test

    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"shapes {a.shape} and {b.shape}, expected (N,) twice")
    differences = (a - b)[np.isfinite(a - b)]
    if not len(differences):
        return PairedComparison(0, float("nan"), float("nan"), 0, float("nan"))
    # One difference is as large with either sign, and scipy takes two or more.
    p_value = 1.0
    if len(differences) > 1:
        # Given as many draws as there are signs, scipy tries each once.
        p_value = permutation_test(
            differences[None], np.mean, permutation_type="samples", n_resamples=draws, rng=rng
        ).pvalue
    return PairedComparison(
        count=len(differences),
        mean_difference=float(np.mean(differences)),
        median_difference=float(np.median(differences)),
        better=int(np.sum(differences < 0.0)),
        p_value=float(p_value),
    )


def nees_bounds(dof: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided bounds of NEES / dof for consistent covariances (Bar-Shalom et al. 2001, 5.4.2)."""
    if dof < 1:
        return float("nan"), float("nan")
    above = 0.5 * (1.0 + np.array([level, -level]))
    low, high = chdtri(dof, above) / dof
    return float(low), float(high)


def pooled_nees(sums: Sequence[tuple[float, int]]) -> float:
    """NEES / dof of several groups, each as (sum of NEES, its degrees of freedom); 1 is consistent."""
    dof = sum(count for _, count in sums)
    return sum(value for value, _ in sums) / dof if dof else float("nan")


def _known(values: ArrayLike) -> FloatArray:
    array = np.asarray(values, dtype=np.float64).ravel()
    return array[~np.isnan(array)]
