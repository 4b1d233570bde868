"""Walls with thickness and doors -> what a scanner sees of them and what a radio path crosses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2

OUTER = 0.30
"""m, thickness of an outer wall."""
INNER = 0.12
"""m, thickness of a wall between rooms: plasterboard on studs or half a brick."""
DOOR = 0.95
"""m, clear width of a door."""
_SIDES = {"n": (0.0, -1.0), "e": (-1.0, 0.0), "s": (0.0, 1.0), "w": (1.0, 0.0)}
"""Into the room, from each side of a rectangle."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight wall along x or y, given by its centre line."""

    start: tuple[float, float]
    """m."""
    end: tuple[float, float]
    """m; larger than `start` along the wall."""
    thickness: float = INNER
    """m."""
    doors: tuple[tuple[float, float], ...] = ()
    """(middle, clear width) m of each opening; middle is its x (y, for a wall along y) in the plan, rising."""

    @property
    def axis(self) -> int:
        """0 along x, 1 along y."""
        return 0 if self.start[1] == self.end[1] else 1


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """One side of a room, as furniture and anchors are put to it."""

    start: Vector2
    """m, one end."""
    along: Vector2
    """Unit vector towards the other end."""
    inward: Vector2
    """Unit vector into the room."""
    length: float
    """m."""

    def at(self, distances: FloatArray | float, away: float) -> Points:
        """(..., 2) m, points `distances` m along the face and `away` m in front of it."""
        points: Points = (
            self.start + np.asarray(distances)[..., None] * self.along + away * self.inward
        )
        return points


class Space(Protocol):
    """A room of any shape; shares (0-1) and sides are as the room itself names them."""

    @property
    def polygon(self) -> Points:
        """(V, 2) m, counter-clockwise, between wall faces."""

    @property
    def yaw(self) -> float:
        """rad, how furniture stands in it."""

    @property
    def middle(self) -> Vector2:
        """(2,) m, sees every wall but what stands in the room."""

    def at(self, across: float, up: float) -> tuple[float, float]:
        """The point at shares (0-1) of width and depth, m."""

    def face(self, side: str) -> Face:
        """The side of that name; ValueError where there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A rectangle between wall faces."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def polygon(self) -> Points:
        """(4, 2) m, counter-clockwise."""
        return np.array(
            [[self.x0, self.y0], [self.x1, self.y0], [self.x1, self.y1], [self.x0, self.y1]]
        )

    @property
    def yaw(self) -> float:
        """rad, along x."""
        return 0.0

    @property
    def middle(self) -> Vector2:
        """(2,) m."""
        return np.array(self.at(0.5, 0.5))

    def face(self, side: str) -> Face:
        """The side `n`, `e`, `s` or `w`, rightwards or upwards in the plan."""
        if side not in _SIDES:
            raise ValueError(f"a rectangle has no side {side!r}")
        inward = np.array(_SIDES[side])
        start = [
            self.x1 if side == "e" else self.x0,
            self.y1 if side == "n" else self.y0,
        ]
        length = self.x1 - self.x0 if side in "ns" else self.y1 - self.y0
        return Face(np.array(start), np.abs(inward[::-1]), inward, length)

    def at(self, across: float, up: float) -> tuple[float, float]:
        """The point at shares (0-1) of width and depth, m."""
        return self.x0 + across * (self.x1 - self.x0), self.y0 + up * (self.y1 - self.y0)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The empty building."""

    faces: FloatArray
    """(W, 2, 2) m, visible."""
    partitions: FloatArray
    """(P, 2, 2) m, centre lines between openings."""
    lintels: FloatArray
    """(L, 2, 2) m, both faces over each door."""
    doors: Points
    """(D, 2) m, their middles."""
    rooms: tuple[Space, ...]


def build_plan(walls: Sequence[Wall], rooms: Sequence[Room], columns: Sequence[Room] = ()) -> Plan:
    """Join walls (and columns, solid rectangles that stand at them) to one building."""
    pieces = [(wall, *span) for wall in walls for span in _solid_spans(wall)]
    slabs = [_slab(wall, low, high) for wall, low, high in pieces]
    slabs += [(column.x0, column.y0, column.x1, column.y1) for column in columns]
    openings = [
        (wall, middle - width / 2, middle + width / 2)
        for wall in walls
        for middle, width in wall.doors
    ]
    lintels = [
        _line(wall, low, high, side * wall.thickness / 2)
        for wall, low, high in openings
        for side in (-1, 1)
    ]
    return Plan(
        faces=outline(np.array(slabs)),
        partitions=np.array(
            [_line(wall, *_unextended(wall, low, high), 0.0) for wall, low, high in pieces]
        ),
        lintels=np.array(lintels).reshape(-1, 2, 2),
        doors=np.array([np.mean(_line(*opening, 0.0), axis=0) for opening in openings]).reshape(
            -1, 2
        ),
        rooms=tuple(rooms),
    )


def outline(rectangles: FloatArray) -> FloatArray:
    """(N, 2, 2) m, the boundary of the union of (K, 4) rectangles x0, y0, x1, y1.

    The plane is cut along every edge; a face is where a solid cell meets a free one. Faces in line are one.
    """
    # Micrometres: edges meant to be one must not leave a sliver between them.
    rectangles = np.round(rectangles, 6)
    xs, ys = np.unique(rectangles[:, [0, 2]]), np.unique(rectangles[:, [1, 3]])
    solid = np.zeros((len(xs) + 1, len(ys) + 1), dtype=np.int8)
    for i0, j0, i1, j1 in np.stack(
        [np.searchsorted(axis, rectangles[:, k]) for k, axis in enumerate((xs, ys, xs, ys))],
        axis=-1,
    ):
        solid[i0 + 1 : i1 + 1, j0 + 1 : j1 + 1] = 1
    upright = _runs(np.diff(solid, axis=0), xs, ys)
    level = _runs(np.diff(solid, axis=1).T, ys, xs)[..., ::-1]
    return np.concatenate([upright, level])


def _runs(
    steps: np.ndarray[tuple[int, int], np.dtype[np.int8]], across: FloatArray, along: FloatArray
) -> FloatArray:
    """Maximal runs of equal steps in each row as segments (N, 2, 2) in the order (across, along)."""
    found = []
    for side in (-1, 1):
        edges = np.diff((steps == side).astype(np.int8), axis=1, prepend=0, append=0)
        rows, starts = np.nonzero(edges == 1)
        _, stops = np.nonzero(edges == -1)
        ends = np.stack([along[starts - 1], along[stops - 1]], axis=-1)
        found.append(np.stack([np.broadcast_to(across[rows][:, None], ends.shape), ends], axis=-1))
    return np.concatenate(found)


def _solid_spans(wall: Wall) -> list[tuple[float, float]]:
    """Pieces between openings, along the axis; the outermost fill the corner with the next wall."""
    low, high = wall.start[wall.axis] - wall.thickness / 2, wall.end[wall.axis] + wall.thickness / 2
    edges = [
        low,
        *(
            edge
            for middle, width in wall.doors
            for edge in (middle - width / 2, middle + width / 2)
        ),
        high,
    ]
    if any(b <= a for a, b in pairwise(edges)):
        raise ValueError(
            f"doors {wall.doors} do not fit in the wall from {wall.start} to {wall.end}"
        )
    return list(zip(edges[::2], edges[1::2], strict=True))


def _unextended(wall: Wall, low: float, high: float) -> tuple[float, float]:
    """A radio path past a corner crosses the walls that meet there, not the stumps that fill it."""
    return max(low, wall.start[wall.axis]), min(high, wall.end[wall.axis])


def _slab(wall: Wall, low: float, high: float) -> tuple[float, float, float, float]:
    (x0, y0), (x1, y1) = (
        _line(wall, low, high, -wall.thickness / 2)[0],
        _line(wall, low, high, wall.thickness / 2)[1],
    )
    return x0, y0, x1, y1


def _line(wall: Wall, low: float, high: float, aside: float) -> list[tuple[float, float]]:
    """End points of the line parallel to the wall, `aside` m towards the larger other coordinate."""
    other = wall.start[1 - wall.axis] + aside
    return [(low, other), (high, other)] if wall.axis == 0 else [(other, low), (other, high)]
