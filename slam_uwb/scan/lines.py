"""Wall segments: split the angle-ordered points, fit each part by least squares (paper, Algorithm 2, line 1).

The paper fits slope and intercept, which fails on walls along y; total least squares is the same
for every direction.
"""

from __future__ import annotations

import numpy as np

from ..model.geometry import FloatArray, Points
from ..model.settings import ScanSettings


def straight_parts(points: Points, gaps: FloatArray, settings: ScanSettings) -> list[np.ndarray]:
    """Indices of points that follow each other along one straight line, part by part, every point once.

    Args:
        points: (N, 2) m, ordered by bearing all the way round.
        gaps: (N,) m; a point further than this from the next one ends a wall there.
        settings: Split distance.
    """
    runs = _runs(points, gaps)
    return [part for run in runs for part in _split(points, run, settings.split_distance_m)]


def extract_segments(
    points: Points, parts: list[np.ndarray], settings: ScanSettings
) -> tuple[FloatArray, list[np.ndarray]]:
    """Wall segments: the straight parts that are long enough.

    Args:
        points: (N, 2) m.
        parts: Of `straight_parts`.
        settings: Least length and number of points.

    Returns:
        (S, 2, 2) end points in the order of the parts, and for each segment the indices of its points.
    """
    segments, members = [], []
    for part in parts:
        if len(part) < settings.min_segment_points:
            continue
        segment = _fit_segment(points[part])
        if np.linalg.norm(segment[1] - segment[0]) >= settings.min_segment_length_m:
            segments.append(segment)
            members.append(part)
    return np.array(segments).reshape(-1, 2, 2), members


def segment_noise(points: Points, segments: FloatArray, members: list[np.ndarray]) -> float:
    """Robust standard deviation of the points about their walls, m; 0.02 where the scan has no wall."""
    if not members:
        return 0.02
    distances = []
    for (start, end), part in zip(segments, members, strict=True):
        direction = (end - start) / np.linalg.norm(end - start)
        offset = points[part] - start
        distances.append(offset[:, 0] * direction[1] - offset[:, 1] * direction[0])
    return float(1.4826 * np.median(np.abs(np.concatenate(distances))))


def _runs(points: Points, gaps: FloatArray) -> list[np.ndarray]:
    """Indices of points that follow each other without a gap; a run may cross the seam of the bearings."""
    count = len(points)
    if count < 2:
        return []
    following = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    ends = np.flatnonzero(following > np.maximum(gaps, np.roll(gaps, -1)))
    # Start behind a gap, so that no wall is cut at the seam; a scan without any gap starts at its
    # furthest point: distance along a straight wall is largest at an end, so that is a corner.
    first = int(ends[0]) + 1 if len(ends) else int(np.argmax(np.hypot(*points.T)))
    if not len(ends) and count >= 5:
        first += _ends_before(points.take(np.arange(first - 2, first + 3), axis=0, mode="wrap"), 2)
    order = (np.arange(count) + first) % count
    cuts = np.flatnonzero(np.isin(order, ends))[:-1] + 1 if len(ends) else np.array([], dtype=int)
    return np.split(order, cuts)


def _split(points: Points, run: np.ndarray, distance: float) -> list[np.ndarray]:
    """Iterative end-point fit: split at the point furthest from the chord until every part is straight."""
    parts, open_parts = [], [run]
    while open_parts:
        part = open_parts.pop()
        if len(part) < 3:
            parts.append(part)
            continue
        away = _from_chord(points[part])
        corner = int(np.argmax(away[1:-1])) + 1
        if away[corner] <= distance:
            parts.append(part)
        else:
            corner += _ends_before(points[part], corner)
            open_parts += [part[corner:], part[:corner]]
    return parts


def _from_chord(part: Points) -> FloatArray:
    """(N,) m from the chord between the first and the last point: from it, not from the line through it.

    Along a straight wall that is largest at an end, also where the run ends about where it began.
    """
    chord, offset = part[-1] - part[0], part - part[0]
    along = np.clip(offset @ chord / max(float(chord @ chord), 1e-18), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - along[:, None] * chord, axis=1))


def _ends_before(part: Points, corner: int) -> bool:
    """Whether the point at a corner is on the line of the two before it rather than of the two behind.

    Given to both walls it would turn the one on which it does not lie.
    """
    if corner < 2 or corner > len(part) - 3:
        return corner >= 2
    misses = []
    for a, b in ((corner - 2, corner - 1), (corner + 1, corner + 2)):
        along, offset = part[b] - part[a], part[corner] - part[a]
        across = along[0] * offset[1] - along[1] * offset[0]
        misses.append(abs(float(across)) / max(float(np.hypot(*along)), 1e-12))
    return misses[0] <= misses[1]


def _fit_segment(points: Points) -> FloatArray:
    """(2, 2) end points of the total-least-squares line through `points`, as far as the first and last reach."""
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
    along = (points[[0, -1]] - centre) @ axes[0]
    return np.asarray(centre + along[:, None] * axes[0])
