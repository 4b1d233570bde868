"""One recording located with one set of anchors: what `position` shows and writes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluate import ErrorSummary, static_errors, trajectory_errors
from ..io.csv_text import Cell, number, table
from ..model.geometry import FloatArray, Points, Pose2, Vector2
from ..model.settings import PositioningSettings
from ..model.survey import AnchorId
from ..model.tag import TagRecording, TagTruth
from ..positioning import PlaceEstimate, Track, locate_stays, track_tag


@dataclass(frozen=True, slots=True, eq=False)
class Positioned:
    """Places in the anchors' frame; what is drawn and scored, in the reference's."""

    track: Track
    """All epochs as one track, of a static recording too."""
    stays: tuple[PlaceEstimate, ...]
    reference_T_anchors: Pose2
    anchors: Points
    """(A, 2) m, reference's frame."""
    errors: dict[str, float] | FloatArray
    """m, by static place, or by epoch; empty without a truth."""

    @property
    def placed(self) -> dict[str, Vector2]:
        """(2,) m of each static place that was found, reference's frame."""
        pose = self.reference_T_anchors
        return {p.id: pose.transform(p.position) for p in self.stays if p.position is not None}

    @property
    def path(self) -> Points:
        """(E, 2) m, reference's frame."""
        return self.reference_T_anchors.transform(self.track.places)

    def summary(self) -> dict[str, Any]:
        """Counts and errors, None where there are none."""
        located = (
            len(self.placed) if self.stays else int(np.isfinite(self.track.states[:, 0]).sum())
        )
        values = list(self.errors.values()) if isinstance(self.errors, dict) else self.errors
        errors = ErrorSummary.of(list(values))
        figures = {"rmse_m": errors.rmse, "median_m": errors.median, "max_m": errors.max}
        return {
            "located": located,
            "expected": len(self.stays) or len(self.track.times),
            **{name: value if math.isfinite(value) else None for name, value in figures.items()},
        }


def locate(
    recording: TagRecording,
    anchors: Mapping[AnchorId, FloatArray],
    settings: PositioningSettings,
    truth: TagTruth | None,
    reference_T_anchors: Pose2 | None,
) -> Positioned:
    """Filter a recording, and score it where there is a truth."""
    pose = reference_T_anchors or Pose2.identity()
    track = track_tag(
        recording.epochs, anchors, recording.tag_height, settings, recording.power_law
    )
    stays = locate_stays(recording, anchors, settings)
    errors: dict[str, float] | FloatArray = {}
    if truth is not None and truth.path is not None:
        errors = trajectory_errors(track, truth.path, pose)
    elif truth is not None:
        errors = static_errors(stays, truth, pose)
    places = pose.transform(np.array([place[:2] for place in anchors.values()]))
    return Positioned(track, stays, pose, places, errors)


def table_files(result: Positioned) -> dict[str, bytes]:
    """track.csv, and places.csv of a static recording; in the frame of the anchors that were given."""
    track = result.track
    rows = map(_epoch, track.times.tolist(), track.states, track.covariances, track.used.tolist())
    header = ("time_s", "x_m", "y_m", "vx_mps", "vy_mps", "sigma_x_m", "sigma_y_m", "measurements")
    files = {"track.csv": table(header, rows)}
    if result.stays:
        files["places.csv"] = table(
            ("place", "x_m", "y_m", "sigma_x_m", "sigma_y_m", "epochs"), map(_stay, result.stays)
        )
    return files


def _epoch(time: float, state: FloatArray, covariance: FloatArray, used: int) -> list[Cell]:
    sigmas = np.sqrt(np.diag(covariance)[:2])
    return [number(time, 6), *(number(value, 4) for value in [*state, *sigmas]), used]


def _stay(item: PlaceEstimate) -> list[Cell]:
    if item.position is None or item.covariance is None:
        return [item.id, "", "", "", "", item.epochs]
    values = [*item.position, *np.sqrt(np.diag(item.covariance))]
    return [item.id, *(number(float(value), 4) for value in values), item.epochs]
