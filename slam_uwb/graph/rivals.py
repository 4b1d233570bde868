"""When another place that explains the ranges is excluded, and when it is not.

How often a device fails is not known before it has failed, and a wrong range may look like one that
went through walls: with few links the right place may be the one at which a single range is a fault,
while a wrong one explains them all. The model's share of faults alone would exclude it.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import FloatArray
from ..model.settings import GraphSettings
from .range_fit import RangeFit

FAULTY = 0.5
"""A range is taken for a fault where that is likelier than not."""
FAR_SIGMAS = 5.0
"""A place that is further from the best one than this is not covered by its covariance."""


def excluding_gaps(minima: RangeFit, faults: FloatArray, settings: GraphSettings) -> FloatArray:
    """Nats by which each place has to cost more than the best one to be excluded.

    One range, that which helps a place most, may be a fault at other odds than the model's:
    exp(`fault_cost_gap` - `mirror_cost_gap`) times as likely. A place with two more faults than the
    best one is not helped, nor one that the covariance of the best one covers.

    Args:
        minima: K places, the best first.
        faults: (K, N) how likely each range is a fault were each place right.
        settings: both gaps, and the factor on covariances.

    Returns:
        (K,)
    """
    gaps = np.full(len(minima.places), settings.mirror_cost_gap)
    odds = math.expm1(max(0.0, settings.fault_cost_gap - settings.mirror_cost_gap))
    forgiven = np.log1p(odds * faults)
    more = ((faults > FAULTY) & (faults[0] < FAULTY)).sum(axis=1)
    information = np.linalg.inv(np.linalg.inv(minima.blocks[0])[:2, :2])
    away = minima.places - minima.places[0]
    squares = np.einsum("ki,ij,kj->k", away, information, away) / settings.anchor_inflation
    helped = (more <= 1) & (squares > FAR_SIGMAS**2)
    return gaps + np.where(helped, (forgiven - forgiven[0]).max(axis=1, initial=0.0), 0.0)
