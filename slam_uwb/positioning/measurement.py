"""One epoch as numbers: what was measured, what a place would give, and how sure the difference is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from ..model.tag import Epoch, PowerLaw, ReceivedPower, TimeDifference
from .anchors import AnchorPlaces

_NEAREST_M = 0.1
"""Below this the logarithm of the distance means nothing."""
_OWN_SHARE = 0.1
"""Of the arrival's sigma that each difference has for itself: all pairs of three anchors repeat each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The usable values of one epoch, time differences first."""

    values: FloatArray
    """(M,) m, then dBm."""
    covariance: FloatArray
    """(M, M) m^2 and dB^2."""
    anchors: FloatArray
    """(A, 3) m, those that the values are of."""
    pairs: NDArray[np.int64]
    """(D, 2) rows of `anchors` of each time difference."""
    heard: NDArray[np.int64]
    """(M - D,) rows of `anchors` of each power."""
    tag_height: float
    power_law: PowerLaw | None

    def predict(self, places: Points) -> FloatArray:
        """(..., M) values that a tag at (..., 2) m would give."""
        flat = np.linalg.norm(places[..., None, :] - self.anchors[:, :2], axis=-1)
        distances = np.hypot(flat, self.anchors[:, 2] - self.tag_height)
        differences = distances[..., self.pairs[:, 0]] - distances[..., self.pairs[:, 1]]
        if self.power_law is None:
            return np.asarray(differences)
        reach = np.maximum(distances[..., self.heard], _NEAREST_M)
        powers = self.power_law.at_one_metre - 10.0 * self.power_law.exponent * np.log10(reach)
        return np.concatenate([differences, powers], axis=-1)


def measurement_of(
    epoch: Epoch,
    anchors: AnchorPlaces,
    tag_height: float,
    power_law: PowerLaw | None,
    arrival_sigma: float,
) -> Measurement:
    """Leave out what is not finite, of anchors that nobody knows, or powers without a law.

    Differences that share an anchor share its error: their covariance is that of independent
    arrivals, not of independent differences.
    """
    differences = _usable_differences(epoch, anchors)
    powers = _usable_powers(epoch, anchors) if power_law is not None else []
    names = [name for item in differences for name in (item.anchor_a, item.anchor_b)]
    rows = {name: k for k, name in enumerate(dict.fromkeys([*names, *(p.anchor for p in powers)]))}
    pairs = np.array(
        [(rows[item.anchor_a], rows[item.anchor_b]) for item in differences], dtype=np.int64
    ).reshape(-1, 2)
    count = len(pairs)
    covariance = np.zeros((count + len(powers),) * 2)
    covariance[:count, :count] = arrival_sigma**2 * _shared(pairs, len(rows))
    if power_law is not None:
        covariance[count:, count:] = power_law.sigma**2 * np.eye(len(powers))
    return Measurement(
        values=np.array([i.difference for i in differences] + [p.power for p in powers]),
        covariance=covariance,
        anchors=np.array([anchors[name] for name in rows]).reshape(-1, 3),
        pairs=pairs,
        heard=np.array([rows[item.anchor] for item in powers], dtype=np.int64),
        tag_height=tag_height,
        power_law=power_law,
    )


def _usable_differences(epoch: Epoch, anchors: AnchorPlaces) -> list[TimeDifference]:
    return [
        item
        for item in epoch.differences
        if math.isfinite(item.difference)
        and item.anchor_a in anchors
        and item.anchor_b in anchors
        and item.anchor_a != item.anchor_b
    ]


def _usable_powers(epoch: Epoch, anchors: AnchorPlaces) -> list[ReceivedPower]:
    return [item for item in epoch.powers if math.isfinite(item.power) and item.anchor in anchors]


def _shared(pairs: NDArray[np.int64], anchors: int) -> FloatArray:
    """(D, D) covariance of the differences (D, 2) of arrivals at `anchors` with variance one."""
    each = np.arange(len(pairs))
    incidence = np.zeros((len(pairs), anchors))
    incidence[each, pairs[:, 0]] = 1.0
    incidence[each, pairs[:, 1]] = -1.0
    return np.asarray(incidence @ incidence.T + _OWN_SHARE**2 * np.eye(len(pairs)))
