"""Static tags: the mean of what the filter says while one lies still (paper, section IV)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import Matrix2, Vector2
from ..model.settings import PositioningSettings
from ..model.tag import Stay, TagRecording
from .anchors import AnchorPlaces
from .tracking import Track, track_tag


@dataclass(frozen=True, slots=True, eq=False)
class PlaceEstimate:
    """Where a tag lay."""

    id: str
    position: Vector2 | None
    """(2,) m in the anchors' frame; None where nothing was heard."""
    covariance: Matrix2 | None
    """(2, 2) m^2, mean of the filter's: errors of links are constant, so they do not average out."""
    epochs: int
    """How many with a place the mean is of."""


def locate_stays(
    recording: TagRecording, anchors: AnchorPlaces, settings: PositioningSettings
) -> tuple[PlaceEstimate, ...]:
    """Each stay by a filter of its own, as a tag of its own."""
    return tuple(_locate(stay, recording, anchors, settings) for stay in recording.stays)


def _locate(
    stay: Stay, recording: TagRecording, anchors: AnchorPlaces, settings: PositioningSettings
) -> PlaceEstimate:
    epochs = [epoch for epoch in recording.epochs if stay.start <= epoch.time < stay.end]
    track = track_tag(epochs, anchors, recording.tag_height, settings, recording.power_law)
    settled = _settled(track, settings.settling_s)
    if not len(settled):
        return PlaceEstimate(stay.id, None, None, 0)
    return PlaceEstimate(
        stay.id,
        track.places[settled].mean(axis=0),
        track.covariances[settled, :2, :2].mean(axis=0),
        len(settled),
    )


def _settled(track: Track, settling: float) -> NDArray[np.intp]:
    """Indices of the epochs after the filter has settled; the last alone where it never did."""
    placed = np.flatnonzero(np.isfinite(track.states[:, 0]))
    if not len(placed):
        return placed
    late = track.times[placed] >= track.times[placed[0]] + settling
    return placed[late] if late.any() else placed[-1:]
