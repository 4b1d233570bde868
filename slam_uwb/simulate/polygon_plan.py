"""Rooms as loops of named corners -> a building whose walls stand in any direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2, rotation_matrix
from .plan import INNER, OUTER, Face, Plan

Corners: TypeAlias = Mapping[str, Vector2]
"""m, where the centre lines of walls meet, by name."""
Doors: TypeAlias = Mapping[str, tuple[float, float]]
"""Share (0-1) of the wall `a-b` at which the middle of its door lies, and clear width in m."""


@dataclass(frozen=True, slots=True, eq=False)
class PolygonRoom:
    """A room of any outline; its width and depth are along and across its first side."""

    names: tuple[str, ...]
    """One a corner; the side from corner a to the next one b is named `a-b`."""
    polygon: Points
    """(V, 2) m, counter-clockwise, between wall faces."""

    @property
    def yaw(self) -> float:
        """rad, of the first side."""
        x, y = self.polygon[1] - self.polygon[0]
        return float(np.arctan2(y, x))

    @property
    def middle(self) -> Vector2:
        """(2,) m, centre of its area."""
        ahead = np.roll(self.polygon, -1, axis=0)
        twice = (self.polygon * ahead[:, ::-1]) @ [1.0, -1.0]
        centre: Vector2 = twice @ (self.polygon + ahead) / (3.0 * twice.sum())
        return centre

    def at(self, across: float, up: float) -> tuple[float, float]:
        """The point at shares (0-1) of width and depth, m."""
        axes = rotation_matrix(self.yaw)
        local = self.polygon @ axes
        low, high = local.min(axis=0), local.max(axis=0)
        x, y = axes @ (low + np.array([across, up]) * (high - low))
        return float(x), float(y)

    @property
    def sides(self) -> tuple[str, ...]:
        """The names of the sides, from the first corner on."""
        return tuple(f"{a}-{b}" for a, b in pairwise([*self.names, self.names[0]]))

    def face(self, side: str) -> Face:
        """The side `a-b`, from corner a on."""
        if side not in self.sides:
            raise ValueError(f"no side {side!r}; there are: {', '.join(self.sides)}")
        k = self.sides.index(side)
        return _face(self.polygon[k], self.polygon[(k + 1) % len(self.polygon)])


def build_polygon_plan(
    corners: Corners,
    loops: Sequence[str],
    doors: Doors,
    inner: float = INNER,
    pillars: Sequence[Points] = (),
) -> Plan:
    """Join rooms that share corners to one building.

    Args:
        corners: by name, between the two faces of the inner walls.
        loops: a room each: its corners `a-b-c-...`, counter-clockwise. A side of one room is either the same
            side of one other room or an outer wall, so that both name the corner where a third wall meets theirs.
        doors: the walls that have one; they come in this order.
        inner: m, thickness of walls between rooms. Outer walls have `OUTER`; their inner face and what a radio
            path crosses lie where those of an inner wall would.
        pillars: (V, 2) m outlines, which like the columns of `build_plan` are no walls to the radio.

    Returns:
        The plan; ValueError where a door does not fit or leads outside.
    """
    rooms = tuple(_room(corners, tuple(loop.split("-")), inner / 2) for loop in loops)
    sides = [side for room in rooms for side in room.sides]
    openings = _openings(corners, doors, sides, inner)
    opening_of = {side: openings.get(_either_way(side)) for side in sides}
    faces = [_pierced(room.face(side), opening_of[side]) for room in rooms for side in room.sides]
    walls = [side for k, side in enumerate(sides) if _reverse(side) not in sides[:k]]
    lines = [_pierced(_centre_line(corners, side), opening_of[side]) for side in walls]
    frames = np.array([_edges(opening) for opening in openings.values()]).reshape(-1, 4, 2, 2)
    jambs, lintels = (frames[:, k::2].reshape(-1, 2, 2) for k in (1, 0))
    shell = _offset(_around(corners, sides), inner / 2 - OUTER)
    return Plan(
        faces=np.concatenate([*faces, jambs, *(_edges(solid) for solid in (shell, *pillars))]),
        partitions=np.concatenate(lines),
        lintels=lintels,
        doors=frames[:, :, 0].mean(axis=1),
        rooms=rooms,
    )


def _room(corners: Corners, names: tuple[str, ...], inwards: float) -> PolygonRoom:
    return PolygonRoom(names, _offset(np.array([corners[name] for name in names]), inwards))


def _reverse(side: str) -> str:
    """The same wall as the room behind it names it."""
    return "-".join(reversed(side.split("-")))


def _either_way(side: str) -> frozenset[str]:
    return frozenset(side.split("-"))


def _face(start: Vector2, end: Vector2) -> Face:
    """From start to end, the room on the left."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    return Face(start, along, np.array([-along[1], along[0]]), length)


def _centre_line(corners: Corners, side: str) -> Face:
    start, end = (np.asarray(corners[name]) for name in side.split("-"))
    return _face(start, end)


def _openings(
    corners: Corners, doors: Doors, sides: Sequence[str], inner: float
) -> dict[frozenset[str], Points]:
    """(4, 2) m round each door, in the order of the doors; ValueError where one leads outside."""
    found = {_either_way(name): _opening(corners, name, *doors[name], inner) for name in doors}
    if outside := [name for name in doors if {name, _reverse(name)} - set(sides)]:
        raise ValueError(f"doors {outside} do not lead from one room to another")
    return found


def _opening(corners: Corners, side: str, share: float, width: float, inner: float) -> Points:
    """(4, 2) m, round a door through the whole thickness of its wall; first along the face to the right."""
    line = _centre_line(corners, side)
    ends = share * line.length + np.array([-width / 2, width / 2])
    return np.concatenate([line.at(ends, -inner / 2), line.at(ends[::-1], inner / 2)])


def _pierced(face: Face, opening: Points | None) -> FloatArray:
    """(N, 2, 2) m, what an opening leaves of a face."""
    ends = face.at(np.array([0.0, face.length]), 0.0)
    if opening is None:
        return ends[None]
    reach = (opening - face.start) @ face.along
    low, high = float(reach.min()), float(reach.max())
    if low <= 0.0 or high >= face.length:
        raise ValueError(
            f"a door from {low:.2f} to {high:.2f} m does not fit in {face.length:.2f} m of wall"
        )
    return np.stack([ends[0], *face.at(np.array([low, high]), 0.0), ends[1]]).reshape(2, 2, 2)


def _around(corners: Corners, sides: Sequence[str]) -> Points:
    """(V, 2) m, counter-clockwise round all rooms: the sides that only one room has, one after the other."""
    after = dict(side.split("-") for side in sides if _reverse(side) not in sides)
    ring = [next(iter(after))]
    for _ in range(len(after) - 1):
        ring.append(after[ring[-1]])
    return np.array([corners[name] for name in ring])


def _offset(polygon: Points, inwards: float) -> Points:
    """(V, 2) m, the polygon with every side moved inwards (outwards where negative), corners mitred."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    before = np.roll(normals, 1, axis=0)
    # The sum of both normals points along the mitre; it is right for sides in line, too, which have no crossing.
    mitres: Points = (normals + before) / (1.0 + (normals * before).sum(axis=1, keepdims=True))
    return polygon + inwards * mitres


def _edges(polygon: Points) -> FloatArray:
    """(V, 2, 2) m, from each corner to the next."""
    return np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)
