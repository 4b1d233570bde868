"""Landmarks: clustered intersections of wall lines, virtual ones included (paper, Algorithm 2, lines 2-6)."""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import FloatArray, Points
from ..model.settings import ScanSettings


def extract_landmarks(segments: FloatArray, settings: ScanSettings) -> Points:
    """(L, 2) m: where the lines through the wall segments (S, 2, 2) meet.

    Lines that meet at less than `min_intersection_deg` are left out (their intersection is
    uncertain along both), as are intersections further than `max_landmark_range_m` from the
    scanner. What lies within `cluster_distance_m` becomes one landmark.
    """
    if len(segments) < 2:
        return np.zeros((0, 2))
    starts = segments[:, 0]
    directions = segments[:, 1] - starts
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    i, j = np.triu_indices(len(segments), k=1)
    cross = directions[i, 0] * directions[j, 1] - directions[i, 1] * directions[j, 0]
    steep = np.abs(cross) >= math.sin(math.radians(settings.min_intersection_deg))
    i, j, cross = i[steep], j[steep], cross[steep]
    between = starts[j] - starts[i]
    along = (between[:, 0] * directions[j, 1] - between[:, 1] * directions[j, 0]) / cross
    crossings = starts[i] + along[:, None] * directions[i]
    crossings = crossings[np.hypot(*crossings.T) <= settings.max_landmark_range_m]
    return _cluster(crossings, settings.cluster_distance_m)


def _cluster(points: Points, distance: float) -> Points:
    """(L, 2) centres of groups of points whose average distance stays below `distance`, ordered by bearing."""
    if len(points) < 2:
        return points
    from scipy.cluster.hierarchy import fcluster, linkage

    labels = fcluster(linkage(points, method="average"), t=distance, criterion="distance") - 1
    sizes = np.bincount(labels)
    centres = np.column_stack(
        [np.bincount(labels, weights=points[:, axis]) / sizes for axis in (0, 1)]
    )
    return np.asarray(centres[np.argsort(np.arctan2(centres[:, 1], centres[:, 0]), kind="stable")])
