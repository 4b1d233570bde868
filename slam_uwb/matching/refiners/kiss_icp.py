"""KISS-ICP's registration against a voxel map (extra `kiss-icp`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...model.errors import MissingLibraryError
from ...model.geometry import FloatArray
from ...model.settings import MatchingSettings
from ..index import ScanIndex
from .optional import named_if_missing
from .refinement import Refinement
from .space import Stage, points_in_space, refine_in_space

_VERSION = "1.3."  # the names below are private to the library
_COARSE_GATE_M = 1.5
# Of the Geman-McClure loss; the library wants the square of its scale.
_COARSE_KERNEL_M2, _FINE_KERNEL_M2 = 0.3, 0.1**2
# Points nearer to another than voxel / sqrt(this) are dropped: with 20, the default, most of a scan.
_POINTS_A_VOXEL = 400
_STEPS, _STILL = 100, 1e-5  # m and rad


def refine_kiss_icp(
    target: ScanIndex, source: ScanIndex, initial: FloatArray, settings: MatchingSettings
) -> Refinement:
    """Move poses target_T_source (K, 3) by KISS-ICP: robust point to point, coarse to fine.

    Stages: within 1.5 m, then within `closest_point_m` (Vizzo et al. 2023; two stages are ours).

    Returns:
        K poses and whether each is an answer (`refine_in_space`).

    Raises:
        MissingLibraryError: KISS-ICP is not installed, or in a version whose names differ.
    """
    with named_if_missing("kiss_icp", "kiss-icp"):
        # Not its public wrappers: they load its configuration, 270 ms in place of 3.
        import kiss_icp
        from kiss_icp.pybind import kiss_icp_pybind
    if not kiss_icp.__version__.startswith(_VERSION):
        raise MissingLibraryError(
            f"settings: matching.refiner: 'kiss_icp' needs version {_VERSION}x, not "
            f"{kiss_icp.__version__}; to install it: pip install 'slam-uwb[kiss-icp]'"
        )
    return refine_in_space(
        target,
        source,
        initial,
        settings,
        lambda: _stages(kiss_icp_pybind, target, source, settings),
    )


def _stages(
    library: Any, target: ScanIndex, source: ScanIndex, settings: MatchingSettings
) -> tuple[Stage, ...]:
    # One thread: the first registration of a process fixes the number for good.
    registration = library._Registration(
        max_num_iterations=_STEPS, convergence_criterion=_STILL, max_num_threads=1
    )
    moving = library._Vector3dVector(points_in_space(source.scan.points))
    fixed = library._Vector3dVector(points_in_space(target.scan.points))

    def stage(gate: float, kernel: float) -> Stage:
        # Partners are sought in adjacent voxels only: smaller ones would hide some within the gate.
        voxels = library._VoxelHashMap(
            voxel_size=gate, max_distance=np.inf, max_points_per_voxel=_POINTS_A_VOXEL
        )
        voxels._add_points(fixed)

        def align(start: FloatArray) -> FloatArray:
            moved = registration._align_points_to_map(
                points=moving,
                voxel_map=voxels,
                initial_guess=start,
                max_correspondance_distance=gate,
                kernel=kernel,
            )
            return np.asarray(moved)

        return align

    return (
        stage(_COARSE_GATE_M, _COARSE_KERNEL_M2),
        stage(settings.closest_point_m, _FINE_KERNEL_M2),
    )
