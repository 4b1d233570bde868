"""The hybrid RSS-TDOA unscented Kalman filter of the paper's section IV, on `filterpy`.

State (x, y, vx, vy) in the anchors' frame, constant velocity with white acceleration. Which anchors
are in view, and which kind of measurement there is, may change from epoch to epoch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..model.errors import MissingLibraryError
from ..model.geometry import FloatArray, Points, frozen_array
from ..model.settings import PositioningSettings
from ..model.tag import Epoch, PowerLaw
from .anchors import AnchorPlaces
from .measurement import Measurement, measurement_of
from .start import start_place

if TYPE_CHECKING:
    from filterpy.kalman import UnscentedKalmanFilter

_ALPHA, _BETA, _KAPPA = 0.5, 2.0, 0.0
"""Spread of the sigma points (van der Merwe 2004): so near that hyperbolas are nearly straight between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Where a tag was at each epoch; NaN before the first measurement."""

    times: FloatArray
    """(E,) s."""
    states: FloatArray
    """(E, 4) m and m/s, x, y, vx, vy in the anchors' frame."""
    covariances: FloatArray
    """(E, 4, 4), the same order."""
    used: NDArray[np.int64]
    """(E,) how many values each epoch gave."""

    def __post_init__(self) -> None:
        count = len(self.times)
        shapes = {"times": (count,), "states": (count, 4), "covariances": (count, 4, 4)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen_array(getattr(self, name), shape, name))
        object.__setattr__(self, "used", frozen_array(self.used, (count,), "used", np.int64))

    @property
    def places(self) -> Points:
        """(E, 2) m."""
        return self.states[:, :2]


def track_tag(
    epochs: Sequence[Epoch],
    anchors: AnchorPlaces,
    tag_height: float,
    settings: PositioningSettings,
    power_law: PowerLaw | None = None,
) -> Track:
    """Filter the epochs of one tag.

    An epoch without a usable measurement only predicts; one with a single value moves the state as
    far as that value tells. A value far from its prediction (a path behind a wall) counts less, in
    proportion: `outlier_sigmas`; the paper's plain filter is a large one.

    Args:
        epochs: In the order of time.
        anchors: Places by name; measurements of others are left out.
        tag_height: m above the floor.
        settings: Noise and start.
        power_law: For received powers, which are left out without one.

    Raises:
        ValueError: The epochs are not in the order of time.
        MissingLibraryError: filterpy is not installed.
    """
    times = np.array([epoch.time for epoch in epochs])
    if np.any(np.diff(times) < 0.0):
        raise ValueError("the epochs are not in the order of time")
    measured = [
        measurement_of(epoch, anchors, tag_height, power_law, settings.arrival_sigma_m)
        for epoch in epochs
    ]
    used = np.array([len(seen.values) for seen in measured], dtype=np.int64)
    everywhere = np.array(list(anchors.values())).reshape(-1, 3)
    return Track(times, *_filtered(times, measured, everywhere, settings), used)


def _filtered(
    times: FloatArray,
    measured: Sequence[Measurement],
    everywhere: FloatArray,
    settings: PositioningSettings,
) -> tuple[FloatArray, FloatArray]:
    """States (E, 4) and their covariances (E, 4, 4), NaN before the first epoch with a value."""
    states, covariances = np.full((len(times), 4), np.nan), np.full((len(times), 4, 4), np.nan)
    tracker: UnscentedKalmanFilter | None = None
    for k, seen in enumerate(measured):
        if tracker is not None:
            _step(tracker, float(times[k] - times[k - 1]), seen, settings)
        elif len(seen.values):
            tracker = _start(seen, everywhere, settings)
        else:
            continue
        states[k], covariances[k] = tracker.x, tracker.P
    return states, covariances


def _start(
    seen: Measurement, everywhere: FloatArray, settings: PositioningSettings
) -> UnscentedKalmanFilter:
    """A filter at the place that the first measurement tells, standing still as far as is known."""
    try:
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
    except ImportError:
        raise MissingLibraryError(
            "positioning needs filterpy: pip install 'slam-uwb[positioning]'"
        ) from None
    tracker = UnscentedKalmanFilter(
        dim_x=4,
        dim_z=1,  # each update brings its own size
        dt=1.0,
        hx=None,
        fx=_move,
        points=MerweScaledSigmaPoints(4, _ALPHA, _BETA, _KAPPA),
    )
    place, covariance = start_place(seen, everywhere, settings)
    tracker.x = np.concatenate([place, np.zeros(2)])
    tracker.P = np.diag([0.0, 0.0, *[settings.start_speed_mps**2] * 2])
    tracker.P[:2, :2] = covariance
    return tracker


def _step(
    tracker: UnscentedKalmanFilter, dt: float, seen: Measurement, settings: PositioningSettings
) -> None:
    tracker.Q = _process_noise(dt, settings.acceleration_mps2)
    tracker.predict(dt)
    if len(seen.values):
        noise = _with_outliers_weakened(tracker, seen, settings.outlier_sigmas)
        tracker.update(seen.values, R=noise, hx=lambda state: seen.predict(state[:2]))
    # Rounding: a covariance that is not quite symmetric stops the next square root.
    tracker.P = 0.5 * (tracker.P + tracker.P.T)


def _move(state: FloatArray, dt: float) -> FloatArray:
    return np.concatenate([state[:2] + dt * state[2:], state[2:]])


def _process_noise(dt: float, acceleration: float) -> FloatArray:
    """(4, 4) of white acceleration held for `dt`, order x, y, vx, vy."""
    from filterpy.common import Q_discrete_white_noise

    noise: Any = Q_discrete_white_noise(
        dim=2, dt=dt, var=acceleration**2, block_size=2, order_by_dim=False
    )
    return np.asarray(noise, dtype=np.float64)


def _with_outliers_weakened(
    tracker: UnscentedKalmanFilter, seen: Measurement, limit: float
) -> FloatArray:
    """(M, M) noise whose outlying values weigh as in Huber's estimate (one step of it)."""
    from filterpy.kalman import unscented_transform

    expected, spread = unscented_transform(
        seen.predict(tracker.sigmas_f[:, :2]), tracker.Wm, tracker.Wc, seen.covariance
    )
    distance = np.abs(seen.values - expected) / np.sqrt(np.diag(spread))
    widened = np.sqrt(np.maximum(distance / limit, 1.0))
    return np.asarray(seen.covariance * np.outer(widened, widened))
