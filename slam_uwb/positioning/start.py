"""Where a track begins: the likeliest place of a grid, by the first epoch that says anything."""

from __future__ import annotations

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Vector2
from ..model.settings import PositioningSettings
from .measurement import Measurement

_MAX_CELLS = 40_000


def start_place(
    measurement: Measurement, everywhere: FloatArray, settings: PositioningSettings
) -> tuple[Vector2, Matrix2]:
    """(2,) m and (2, 2) m^2 of the tag by one epoch alone, whatever the number of its values.

    Time differences of few anchors fit two places, and a filter that starts at the wrong one may
    stay there; so all of the area is looked at, and the covariance holds all that is likely.

    Args:
        measurement: Of at least one value.
        everywhere: (A, 3) m, all anchors; the tag is sought round them.
        settings: Grid, and what is an outlier.
    """
    cells = _grid(everywhere[:, :2], settings)
    whitened = np.linalg.solve(
        np.linalg.cholesky(measurement.covariance),
        (measurement.values - measurement.predict(cells)).T,
    )
    # Huber's cost: one late arrival must not push the start out of the building.
    size, limit = np.abs(whitened), settings.outlier_sigmas
    costs = np.where(size < limit, 0.5 * size**2, limit * (size - 0.5 * limit)).sum(axis=0)
    weights = np.exp(costs.min() - costs)
    weights /= weights.sum()
    place = cells[np.argmin(costs)]
    away = cells - place
    cell = np.eye(2) * settings.search_step_m**2
    return place, np.einsum("n,ni,nj->ij", weights, away, away) + cell


def _grid(anchors: FloatArray, settings: PositioningSettings) -> FloatArray:
    low = anchors.min(axis=0) - settings.search_margin_m
    high = anchors.max(axis=0) + settings.search_margin_m
    # A wrong anchor a kilometre off must not fill the memory.
    step = max(settings.search_step_m, float(np.sqrt(np.prod(high - low) / _MAX_CELLS)))
    x, y = (np.arange(a, b + step, step) for a, b in zip(low, high, strict=True))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
