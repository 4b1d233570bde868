"""How far apart two stations are at least, by their ranges alone: before anything is placed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.geometry import FloatArray
from ..model.products import LinkMeasurement
from ..model.survey import StationId

_CHUNK = 8  # stations at a time; bounds memory


def least_separation(stations: Sequence[StationId], links: Sequence[LinkMeasurement]) -> FloatArray:
    """(S, S) m that each two stations are apart at least, but for what walls add to a range.

    By the triangle inequality two ranges to one anchor differ by no more than the stations are
    apart. The second largest difference counts, so that one bad link separates nothing. Stations
    that hear anchors but none in common are infinitely far apart; where one of them hears none
    nothing is known: 0.
    """
    row = {station: index for index, station in enumerate(stations)}
    column = {name: index for index, name in enumerate(sorted({link.anchor for link in links}))}
    ranges = np.full((len(row), len(column)), np.nan)
    for link in links:
        if link.rejection is None and link.station in row:
            ranges[row[link.station], column[link.anchor]] = link.distance
    heard = np.isfinite(ranges)
    both = heard.any(axis=1)[:, None] & heard.any(axis=1)
    separation = np.zeros((len(row), len(row)))
    for first in range(0, len(row), _CHUNK):
        part = slice(first, first + _CHUNK)
        differences = np.abs(ranges[part, None, :] - ranges[None, :, :])
        common = np.isfinite(differences).sum(axis=2)
        ordered = np.sort(np.nan_to_num(differences, nan=-1.0), axis=2)
        second = ordered[:, :, -2] if ordered.shape[2] > 1 else np.zeros(common.shape)
        separation[part] = np.where(common == 0, np.inf, np.maximum(second, 0.0))
    return np.where(both, separation, 0.0)
