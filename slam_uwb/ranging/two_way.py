"""Double-sided two-way ranging: four measured periods of an exchange -> one distance.

Columns of `periods` are those of the paper's Fig. 3: T1 tag round trip, T2 anchor reply, T3 tag
reply, T4 anchor round trip. The tag's clock measures T1 and T3, the anchor's T2 and T4 (eq. 1).
"""

from __future__ import annotations

import numpy as np

from ..model.geometry import FloatArray

SPEED_OF_LIGHT = 299_792_458.0
"""m/s, in vacuum (exact); in air it is 0.03 % less, 3 mm over 10 m."""


def symmetric_distances(periods: FloatArray) -> FloatArray:
    """Distances by the symmetric formula, eq. 2 of the paper.

    Args:
        periods: (K, 4) seconds, T1 to T4 as measured.

    Returns:
        (K,) metres; biased by clock errors where the two replies differ, see `symmetric_bias`.
    """
    t1, t2, t3, t4 = periods.T
    return np.asarray(SPEED_OF_LIGHT * ((t1 - t2) + (t4 - t3)) / 4.0)


def asymmetric_distances(periods: FloatArray) -> FloatArray:
    """Distances by the asymmetric formula, (T1 T4 - T2 T3) / (T1 + T2 + T3 + T4).

    The replies need not be equal: clock errors enter only as a factor on the distance itself, see
    `asymmetric_bias` (Neirynck, Luk, McLaughlin: An Alternative Double-Sided Two-Way Ranging
    Method, WPNC 2016).

    Args:
        periods: (K, 4) seconds, T1 to T4 as measured.

    Returns:
        (K,) metres; NaN where the periods sum to zero.
    """
    t1, t2, t3, t4 = periods.T
    total = t1 + t2 + t3 + t4
    # T1 T4 - T2 T3 is a small difference of large products. With T1 = T2 + a and T4 = T3 + b it is
    # a T3 + b T2 + a b, which loses nothing.
    tag_excess, anchor_excess = t1 - t2, t4 - t3
    numerator = tag_excess * t3 + anchor_excess * t2 + tag_excess * anchor_excess
    flight = np.full_like(total, np.nan)
    np.divide(numerator, total, out=flight, where=total != 0.0)
    return np.asarray(SPEED_OF_LIGHT * flight)


def symmetric_bias(periods: FloatArray, tag_error: float, anchor_error: float) -> FloatArray:
    """What clock errors add to `symmetric_distances`, the second term of eq. 3.

    Args:
        periods: (K, 4) seconds, the true T1 to T4.
        tag_error: relative error of the tag's clock (epsilon_T), e.g. 1e-5 for 10 ppm.
        anchor_error: relative error of the anchor's clock (epsilon_AN).

    Returns:
        (K,) metres: measured minus true.
    """
    t1, t2, t3, t4 = periods.T
    bias = ((t1 - t3) * tag_error + (t4 - t2) * anchor_error) / 4.0
    return np.asarray(SPEED_OF_LIGHT * bias)


def asymmetric_bias(distances: FloatArray, tag_error: float, anchor_error: float) -> FloatArray:
    """What clock errors add to `asymmetric_distances`: the mean relative error of both clocks.

    Args:
        distances: (K,) metres, true.
        tag_error: relative error of the tag's clock.
        anchor_error: relative error of the anchor's clock.

    Returns:
        (K,) metres: measured minus true, to first order; 0.1 mm at 10 m and 10 ppm.
    """
    return distances * (tag_error + anchor_error) / 2.0
