"""Errors of located tags, as the paper's section IV defines them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..model.geometry import FloatArray, Points, Pose2
from ..model.tag import TagTruth
from ..positioning import PlaceEstimate, Track


def static_errors(
    estimates: Sequence[PlaceEstimate],
    truth: TagTruth,
    reference_T_anchors: Pose2 | None = None,
) -> dict[str, float]:
    """Distance in m of each static tag's mean place from where it lay; NaN where it was not found.

    Args:
        estimates: In the anchors' frame.
        truth: In the reference's frame; places that it does not know are left out.
        reference_T_anchors: Between the two; None where they are one.
    """
    pose = Pose2.identity() if reference_T_anchors is None else reference_T_anchors
    errors = {}
    for item in estimates:
        if item.id not in truth.places:
            continue
        errors[item.id] = math.nan
        if item.position is not None:
            away = pose.transform(item.position) - truth.places[item.id]
            errors[item.id] = float(np.linalg.norm(away))
    return errors


def trajectory_errors(
    track: Track, path: Points, reference_T_anchors: Pose2 | None = None
) -> FloatArray:
    """(E,) m from each place of a track to the closest point of the path walked; NaN where there is none.

    It says nothing of how far along the path the tag was thought to be.

    Args:
        track: In the anchors' frame.
        path: (N, 2) m, corners in order, in the reference's frame.
        reference_T_anchors: Between the two; None where they are one.
    """
    pose = Pose2.identity() if reference_T_anchors is None else reference_T_anchors
    return distances_to_path(pose.transform(track.places), path)


def distances_to_path(points: Points, path: Points) -> FloatArray:
    """(P,) m from each point (P, 2) to the closest point of the path (N, 2), N >= 1."""
    starts = path[:-1] if len(path) > 1 else path
    legs = path[1:] - path[:-1] if len(path) > 1 else np.zeros((1, 2))
    offsets = points[:, None] - starts
    # A leg of no length is its start.
    squared = np.maximum(np.sum(legs**2, axis=1), 1e-30)
    shares = np.clip(np.sum(offsets * legs, axis=-1) / squared, 0.0, 1.0)
    gaps = np.linalg.norm(offsets - shares[..., None] * legs, axis=-1)
    return np.asarray(gaps.min(axis=1))
