"""Plane geometry of the simulator: who sees whom, how far a point is from a wall, what a ray hits."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points

BoolArray: TypeAlias = NDArray[np.bool_]
"""Any array of truth values."""

_ANGLE_SLACK = 1e-12
"""rad; keeps a ray into the seam of two walls from slipping between them."""


def crossing_fractions(starts: Points, ends: Points, segments: FloatArray) -> FloatArray:
    """Where straight paths cross segments.

    Args:
        starts: (N, 2) m.
        ends: (N, 2) m.
        segments: (M, 2, 2) m.

    Returns:
        (N, M) share of the path, 0-1, at which it crosses the segment; NaN where it does not.
    """
    path = (ends - starts)[:, None]
    along = (segments[:, 1] - segments[:, 0])[None]
    to_segment = segments[None, :, 0] - starts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        denominator = _cross(path, along)
        on_path = _cross(to_segment, along) / denominator
        on_segment = _cross(to_segment, path) / denominator
        hit = (on_path >= 0) & (on_path <= 1) & (on_segment >= 0) & (on_segment <= 1)
    fractions: FloatArray = np.where(hit, on_path, np.nan)
    return fractions


def clear_paths(starts: Points, ends: Points, segments: FloatArray) -> BoolArray:
    """(N,) True where the straight path from (N, 2) to (N, 2) crosses none of the (M, 2, 2) segments."""
    clear = ~np.isfinite(crossing_fractions(starts, ends, segments)).any(axis=1)
    return np.asarray(clear, dtype=np.bool_)


def distances_to_segments(points: Points, segments: FloatArray) -> FloatArray:
    """(N, M) m from each of the (N, 2) points to the nearest point of each (M, 2, 2) segment."""
    along = segments[:, 1] - segments[:, 0]
    offset = points[:, None] - segments[None, :, 0]
    squared = np.maximum((along**2).sum(axis=-1), 1e-30)
    share = np.clip((offset * along).sum(axis=-1) / squared, 0.0, 1.0)
    distances: FloatArray = np.linalg.norm(offset - share[..., None] * along, axis=-1)
    return distances


def segments_near(segments: FloatArray, points: Points, margin: float = 0.0) -> FloatArray:
    """The (M, 2, 2) segments that reach into the upright box round the (N, 2) points, `margin` m wider."""
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    reaches = (segments.max(axis=1) >= low) & (segments.min(axis=1) <= high)
    near: FloatArray = segments[reaches.all(axis=1)]
    return near


def cast_rays(origin: Points, bearings: FloatArray, segments: FloatArray) -> FloatArray:
    """Exact distance along each ray to the first segment it meets.

    Each segment is compared only with the rays inside the angle that it fills, a slice of the sorted rays: the
    work is rays times walls behind one another, not rays times walls.

    Args:
        origin: (2,) m.
        bearings: (N,) rad in the frame of the segments, any order, any turn.
        segments: (M, 2, 2) m.

    Returns:
        (N,) m; infinite where nothing is met.
    """
    turned = np.mod(bearings, 2.0 * np.pi)
    order = np.argsort(turned)
    # Twice round, so that a segment across bearing zero is one slice too.
    angles = np.concatenate([turned[order], turned[order] + 2.0 * np.pi])
    cosines, sines = np.cos(angles), np.sin(angles)
    ends = segments - origin
    first, last, distances, normals = _fields_of_view(ends)
    starts = np.searchsorted(angles, first - _ANGLE_SLACK)
    stops = np.searchsorted(angles, last + _ANGLE_SLACK, side="right")
    nearest = np.full(len(angles), np.inf)
    for start, stop, distance, (nx, ny) in zip(starts, stops, distances, normals, strict=True):
        view = slice(start, stop)
        slope = nx * cosines[view] + ny * sines[view]
        reach = np.full(stop - start, np.inf)
        np.divide(distance, slope, out=reach, where=slope > 0)
        np.minimum(nearest[view], reach, out=nearest[view])
    count = len(bearings)
    ranges = np.empty(count)
    ranges[order] = np.minimum(nearest[:count], nearest[count:])
    return ranges


def _fields_of_view(ends: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """First and last bearing, distance of the line and its unit normal, of segments seen from (0, 0)."""
    bearings = np.mod(np.arctan2(ends[..., 1], ends[..., 0]), 2.0 * np.pi)
    sweep = np.remainder(bearings[:, 1] - bearings[:, 0] + np.pi, 2.0 * np.pi) - np.pi
    first = np.where(sweep >= 0, bearings[:, 0], bearings[:, 1])
    along = ends[:, 1] - ends[:, 0]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
    distances = (normals * ends[:, 0]).sum(axis=-1)
    away = np.where(distances < 0, -1.0, 1.0)
    return first, first + np.abs(sweep), distances * away, normals * away[:, None]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
