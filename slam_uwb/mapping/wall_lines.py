"""Wall segments of many scans -> the lines they lie on, one a face.

A line knows from which side it was seen: the two faces of a wall 12 cm thick are two lines, however
badly the poses agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Points, frozen_array


@dataclass(frozen=True, slots=True, eq=False)
class WallLines:
    """Straight lines `normals @ x = offsets` and how far segments reach on them; world frame."""

    normals: Points
    """(L, 2) unit, into the room that the line was seen from."""
    offsets: FloatArray
    """(L,) m."""
    reach: FloatArray
    """(L, 2) m, first and last place along `directions` that a segment covers."""
    support: FloatArray
    """(L,) m, the segments' lengths together."""

    def __post_init__(self) -> None:
        count = len(self.normals)
        object.__setattr__(self, "normals", frozen_array(self.normals, (count, 2), "normals"))
        object.__setattr__(self, "offsets", frozen_array(self.offsets, (count,), "offsets"))
        object.__setattr__(self, "reach", frozen_array(self.reach, (count, 2), "reach"))
        object.__setattr__(self, "support", frozen_array(self.support, (count,), "support"))

    @property
    def directions(self) -> Points:
        """(L, 2) unit; whoever walks along them has the room on the left."""
        return np.asarray(self.normals[:, ::-1] * np.array([1.0, -1.0]))

    def points(self, line: np.ndarray, places: FloatArray) -> Points:
        """(N, 2) m, the points `places` (N,) m along the lines with the numbers `line` (N,)."""
        return np.asarray(
            self.offsets[line, None] * self.normals[line] + places[:, None] * self.directions[line]
        )


def common_lines(segments: FloatArray, angle: float, distance: float) -> WallLines:
    """Lines through segments that lie on one, each the total-least-squares fit to its segments.

    The longest segment starts a line and takes along whatever lies on it, over any gap; then the
    longest that is left. A segment counts with its length, as if it were a row of points.

    Args:
        segments: (S, 2, 2) m; whoever walks from the first end to the second has the scanner on the
            left.
        angle: rad between a segment and its line at most.
        distance: m from an end of a segment to its line at most.
    """
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    segments, lengths = segments[lengths > 0.0], lengths[lengths > 0.0]
    along = (segments[:, 1] - segments[:, 0]) / lengths[:, None]
    middles = segments.mean(axis=1)
    spread = lengths[:, None, None] ** 3 / 12.0 * along[:, :, None] * along[:, None, :]

    left = np.argsort(-lengths, kind="stable")
    found: list[FloatArray] = []
    while len(left):
        direction, through = along[left[0]], middles[left[0]]
        members = np.zeros(len(left), dtype=np.bool_)
        # Refitted, the line may take a segment more or lose one; more rounds change nothing.
        for _ in range(2):
            members = _lies_on(segments[left], along[left], direction, through, angle, distance)
            members[0] = True
            own = left[members]
            direction, through = _fit(middles[own], lengths[own], spread[own], direction)
        places = segments[left[members]] @ direction
        normal = np.array([-direction[1], direction[0]])
        reach = places.min(), places.max()
        found.append(np.array([*normal, normal @ through, *reach, lengths[left[members]].sum()]))
        left = left[~members]
    table = np.array(found).reshape(-1, 6)
    return WallLines(table[:, :2], table[:, 2], table[:, 3:5], table[:, 5])


def _lies_on(
    segments: FloatArray,
    along: Points,
    direction: FloatArray,
    through: FloatArray,
    angle: float,
    distance: float,
) -> np.ndarray:
    """(S,) whether both ends are close to the line and the segment was seen from the same side."""
    offset = segments - through
    across = offset[:, :, 1] * direction[0] - offset[:, :, 0] * direction[1]
    close = np.all(np.abs(across) <= distance, axis=1)
    return np.asarray(close & (along @ direction >= math.cos(angle)))


def _fit(
    middles: Points, lengths: FloatArray, spread: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Direction, the same way as the one given, and centre of the segments' points."""
    centre = lengths @ middles / lengths.sum()
    away = middles - centre
    scatter = spread.sum(axis=0) + (away * lengths[:, None]).T @ away
    _, axes = np.linalg.eigh(scatter)
    fitted = axes[:, 1]
    return (fitted if fitted @ direction > 0.0 else -fitted), centre
