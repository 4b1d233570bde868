"""Scans and poses of the plane as the 3-D values that point cloud libraries take, and back.

The libraries return a pose whatever happened: where nothing was near, where they took no step, and
where one wall let them turn the scan upside down. What counts as an answer is judged here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray, Points
from ...model.settings import MatchingSettings
from ..batch import wrapped
from ..correspondences import partner_count
from ..index import ScanIndex
from .refinement import Refinement

Stage = Callable[[FloatArray], FloatArray]
"""One registration: (4, 4) target_T_source in, (4, 4) better one out."""

_FLAT = 1e-6  # of a motion that stays in the plane: m, and entries of the rotation
_MOVED = 1e-9  # m and rad; a library that took no step gives its start back, to rounding
# Of the smaller scan's points; 363 of 365 right matches of simulated pairs with an overlap from 0.12.
_LEAST_SHARE = 0.1
_LEAST_PARTNERS = 10


def refine_in_space(
    target: ScanIndex,
    source: ScanIndex,
    initial: FloatArray,
    settings: MatchingSettings,
    make_stages: Callable[[], Sequence[Stage]],
) -> Refinement:
    """Run each pose target_T_source of `initial` (K, 3) through the stages.

    `make_stages` is called only with scans that a library can be trusted with.

    Returns:
        K poses, the start's where a stage left the plane, and whether each is an answer: it is not
        the start itself, and enough points face a wall within `fine_gate_m`.
    """
    starts = np.array(initial, dtype=np.float64).reshape(-1, 3)
    poses = starts.copy()
    answers: NDArray[np.bool_] = np.asarray(np.isfinite(starts).all(axis=1))
    if not (_is_sound(target) and _is_sound(source)):
        return Refinement(poses, np.zeros(len(poses), dtype=bool), None)
    stages = make_stages()
    for index in np.flatnonzero(answers):
        end = _through(stages, starts[index])
        answers[index] = end is not None
        poses[index] = starts[index] if end is None else end
    step = poses[answers] - starts[answers]
    step[:, 2] = wrapped(step[:, 2])
    moved = (np.abs(step) > _MOVED).any(axis=1)
    answers[answers] = moved & _has_partners(target, source, poses[answers], settings)
    return Refinement(poses, answers, None)


def _is_sound(index: ScanIndex) -> bool:
    """The libraries take NaN and empty clouds without a word."""
    return len(index.scan.points) >= 3 and bool(np.isfinite(index.scan.points).all())


def _through(stages: Sequence[Stage], start: FloatArray) -> FloatArray | None:
    """The pose (3,) after all stages; None where one of them left the plane."""
    pose: FloatArray | None = start
    for stage in stages:
        if pose is None:
            break
        pose = pose_in_plane(stage(pose_in_space(pose)))
    return pose


def _has_partners(
    target: ScanIndex, source: ScanIndex, poses: FloatArray, settings: MatchingSettings
) -> NDArray[np.bool_]:
    """(K,) whether enough points of the source lie near a wall of the target that faces the same way."""
    partners = partner_count(target, source, poses, settings.fine_gate_m)
    smaller = min(len(target.scan.points), len(source.scan.points))
    return np.asarray(partners >= max(_LEAST_PARTNERS, _LEAST_SHARE * smaller))


def points_in_space(points: Points) -> FloatArray:
    """(N, 3) points at height zero from (N, 2)."""
    return np.column_stack([points, np.zeros(len(points))])


def pose_in_space(pose: FloatArray) -> FloatArray:
    """(4, 4) motion about the vertical axis from (x, y, theta).

    Made from cosine and sine each time: KISS-ICP aborts the process, past any `except`, where a
    rotation is not orthonormal to float precision.
    """
    x, y, theta = (float(value) for value in pose)
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def pose_in_plane(matrix: FloatArray) -> FloatArray | None:
    """(x, y, theta) from a (4, 4) motion; None where it is not finite or leaves the plane.

    A straight wall is also matched by turning the scan upside down about it: a proper rotation in
    space, a mirror image on the floor.
    """
    upright = abs(matrix[2, 2] - 1.0) < _FLAT and abs(matrix[2, 3]) < _FLAT
    if not (upright and np.isfinite(matrix).all()):
        return None
    return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])
