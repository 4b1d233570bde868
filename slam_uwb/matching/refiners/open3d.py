"""Open3D's registration on planar scans (extra `open3d`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...model.geometry import FloatArray
from ...model.settings import MatchingSettings
from ..index import ScanIndex
from .optional import named_if_missing
from .refinement import Refinement
from .space import Stage, points_in_space, refine_in_space

# Point to point reaches further than point to line: with starts 0.4 m and 20 degrees off it brings
# 183 of 240 simulated pairs together, point to line alone 174, in two thirds of the time.
_COARSE_GATE_M, _MIDDLE_GATE_M = 1.5, 0.4
_CAUCHY_M = 0.03  # in the last stage only: earlier it shrinks the basin
_STEPS = 30  # of each stage


def refine_open3d(
    target: ScanIndex, source: ScanIndex, initial: FloatArray, settings: MatchingSettings
) -> Refinement:
    """Move poses target_T_source (K, 3) by Open3D's ICP, coarse to fine.

    Stages: point to point within 1.5 m, point to line within 0.4 m, point to line within
    `fine_gate_m` with a Cauchy loss. Point to line is Open3D's point to plane with the walls'
    normals. Unlike `point_to_line` it does not tell the two faces of a wall apart, and a corridor
    without an end slides along its axis by decimetres (the covariance says that it may).

    Returns:
        K poses and whether each is an answer (`refine_in_space`).

    Raises:
        MissingLibraryError: Open3D, or a library of the system that it loads, is not installed.
    """
    with named_if_missing("open3d", "open3d"):
        import open3d
    with _one_thread(open3d):
        return refine_in_space(
            target, source, initial, settings, lambda: _stages(open3d, target, source, settings)
        )


def _stages(
    open3d: Any, target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> tuple[Stage, ...]:
    registration = open3d.pipelines.registration
    criteria = registration.ICPConvergenceCriteria(max_iteration=_STEPS)
    fixed, moving = _cloud(open3d, target), _cloud(open3d, source)

    def stage(gate: float, estimation: Any) -> Stage:
        def align(start: FloatArray) -> FloatArray:
            result = registration.registration_icp(moving, fixed, gate, start, estimation, criteria)
            return np.asarray(result.transformation)

        return align

    to_line = registration.TransformationEstimationPointToPlane
    return (
        stage(_COARSE_GATE_M, registration.TransformationEstimationPointToPoint()),
        stage(_MIDDLE_GATE_M, to_line()),
        stage(settings.fine_gate_m, to_line(registration.CauchyLoss(_CAUCHY_M))),
    )


def _cloud(open3d: Any, index: ScanIndex) -> Any:
    """The scan at height zero with the walls' own normals.

    Open3D's `estimate_normals` would see a floor and point them upwards; point to plane then finds
    everything in place and returns the start with a fitness of 1. Points without a normal have a
    zero one and do not pull.
    """
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(points_in_space(index.scan.points))
    cloud.normals = open3d.utility.Vector3dVector(points_in_space(index.scan.normals))
    return cloud


@contextmanager
def _one_thread(open3d: Any) -> Iterator[None]:
    """Threads add up in any order, so that last digits differ from run to run; scans are too small to gain."""
    before = open3d.utility.get_max_threads()
    open3d.utility.set_max_threads(1)
    try:
        yield
    finally:
        open3d.utility.set_max_threads(before)
