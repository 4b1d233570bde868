"""Are the errors as large as the solution's covariances say? NEES after an alignment.

The alignment absorbs a shift and a turn of the aligned items, so the errors that remain are not
those that the covariances describe (which are relative to the solution's own frame, where its first
station is certain). To first order the remaining errors are linear in the original ones, which gives
their covariance. NEES: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
Navigation* (2001), section 5.4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.geometry import FloatArray, Pose2
from .estimates import Estimate


def aligned_covariances(
    items: Sequence[Estimate], joint: FloatArray, reference_T_world: Pose2, aligned: Sequence[int]
) -> list[FloatArray | None]:
    """Covariance of each item's error in the reference's frame, after an alignment on some of them.

    Args:
        items: Stations, then anchors.
        joint: (3 N, 3 N) as `joint_covariance` gives it; the items' own covariances take the place
            of its diagonal blocks, since they are what the solution promises.
        reference_T_world: The alignment.
        aligned: Which items it rests on; none where the frame was given.

    Returns:
        (2, 2) or, with a heading, (3, 3) for each item; None for one without a covariance.
    """
    covariance = joint.copy()
    for k, item in enumerate(items):
        if item.covariance is not None:
            size = len(item.covariance)
            covariance[3 * k : 3 * k + size, 3 * k : 3 * k + size] = item.covariance
    blocks = covariance.reshape(len(items), 3, len(items), 3)
    axes = np.eye(3)
    axes[:2, :2] = reference_T_world.rotation
    blocks = np.einsum("ia,kalb,jb->kilj", axes, blocks, axes)
    own = np.einsum("kikj->kij", blocks)
    if len(aligned):
        own = _without_gauge(items, blocks, reference_T_world, aligned)
    return [
        None if item.covariance is None else own[k, : len(item.covariance), : len(item.covariance)]
        for k, item in enumerate(items)
    ]


def _without_gauge(
    items: Sequence[Estimate], blocks: FloatArray, reference_T_world: Pose2, aligned: Sequence[int]
) -> FloatArray:
    """(N, 3, 3) covariances of e - G K e; K e is the shift and turn that the alignment takes out."""
    places = np.array([(0.0, 0.0) if item.position is None else item.position for item in items])
    places = reference_T_world.transform(places)
    places -= places[list(aligned)].mean(axis=0)
    motion = np.tile(np.eye(3), (len(items), 1, 1))
    motion[:, 0, 2], motion[:, 1, 2] = -places[:, 1], places[:, 0]
    # About the centre of the aligned items shift and turn separate: a diagonal normal matrix.
    normal = np.array([len(aligned), len(aligned), np.sum(places[list(aligned)] ** 2)])
    gain = motion[list(aligned), :2].transpose(0, 2, 1) / normal[:, None]
    with_gauge = np.einsum("kilj,lgj->kig", blocks[:, :, list(aligned), :2], gain)
    gauge = np.einsum("kgi,kih->gh", gain, with_gauge[list(aligned), :2])
    own = np.einsum("kikj->kij", blocks)
    cross = with_gauge @ motion.transpose(0, 2, 1)
    return np.asarray(
        own - cross - cross.transpose(0, 2, 1) + motion @ gauge @ motion.transpose(0, 2, 1)
    )


def squared_error(error: FloatArray, covariance: FloatArray | None) -> tuple[float, int]:
    """NEES of an error (d,) and d; (NaN, 0) where the covariance cannot tell.

    That is so where there is none or it is singular: of a place that the frame itself fixes, or of
    one of two points that the alignment brought on their line. Of a (3, 3) covariance with a (2,)
    error the heading is left out.
    """
    if covariance is None or not np.isfinite(covariance).all():
        return float("nan"), 0
    size = min(len(error), len(covariance))
    values, vectors = np.linalg.eigh(covariance[:size, :size])
    if values[0] <= 1e-9 * values[-1]:
        return float("nan"), 0
    return float(np.sum((vectors.T @ error[:size]) ** 2 / values)), size
