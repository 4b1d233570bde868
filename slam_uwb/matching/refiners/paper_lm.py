"""The paper's refinement: Levenberg-Marquardt on the points that have a close partner (Algorithm 4)."""

from __future__ import annotations

import numpy as np

from ...model.geometry import FloatArray, Pose2
from ...model.settings import MatchingSettings
from ..index import ScanIndex
from .refinement import Refinement


def refine_paper_lm(
    target: ScanIndex, source: ScanIndex, initial: FloatArray, settings: MatchingSettings
) -> Refinement:
    """Move poses target_T_source (K, 3) by point-to-point least squares (Algorithm 4, lines 3-5).

    The points that have a closest point nearer than `closest_point_m` at the initial match are
    kept, and the sum of their squared distances to whatever target point is closest is minimised.

    Returns:
        K refined poses and whether the optimiser converged with at least three points.
    """
    from scipy.optimize import least_squares
    from scipy.spatial import cKDTree

    tree = cKDTree(target.scan.points)
    poses = np.array(initial, dtype=np.float64).reshape(-1, 3)
    converged = np.zeros(len(poses), dtype=bool)
    iterations = np.zeros(len(poses), dtype=np.int64)
    for index, start in enumerate(poses):
        moved = Pose2.from_vector(start).transform(source.scan.points)
        fitted = source.scan.points[tree.query(moved)[0] < settings.closest_point_m]
        if len(fitted) < 3:
            continue

        def residual(pose: FloatArray, points: FloatArray = fitted) -> FloatArray:
            placed = Pose2.from_vector(pose).transform(points)
            return np.asarray((placed - target.scan.points[tree.query(placed)[1]]).ravel())

        def jacobian(pose: FloatArray, points: FloatArray = fitted) -> FloatArray:
            turned = Pose2(0.0, 0.0, pose[2]).transform(points)
            rows = np.zeros((len(points), 2, 3))
            rows[:, 0, 0] = rows[:, 1, 1] = 1.0
            rows[:, 0, 2], rows[:, 1, 2] = -turned[:, 1], turned[:, 0]
            return rows.reshape(-1, 3)

        result = least_squares(residual, start, jac=jacobian, method="lm", max_nfev=100)
        poses[index], converged[index] = result.x, result.status > 0
        iterations[index] = result.njev or 0
    return Refinement(poses, converged, iterations)
