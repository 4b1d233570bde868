"""Furniture: rectangles with a height, put where it disturbs neither doors nor tripods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Points, rotation_matrix
from .plan import Plan, Space
from .segments import clear_paths, crossing_fractions

KINDS: dict[str, tuple[float, float, float]] = {
    "bed": (1.6, 2.0, 0.55),
    "bookshelf": (1.2, 0.35, 1.90),
    "cupboard": (1.0, 0.45, 1.85),
    "desk": (1.5, 0.75, 0.74),
    "fridge": (0.6, 0.65, 1.80),
    "plant": (0.4, 0.4, 1.55),
    "screen": (1.5, 0.08, 1.50),
    "sofa": (1.9, 0.9, 0.80),
    "table": (1.5, 0.9, 0.75),
    "wardrobe": (1.7, 0.6, 1.95),
}
"""Width along the wall, depth and height in m: furniture stays under 2 m both ways."""
_TALL = 1.2
"""m; what is higher may stand between two scanners."""
_STATION_CLEARANCE, _DOOR_CLEARANCE = 0.42, 0.80
"""m to tripods (0.4 asked) and to the middle of a door."""


@dataclass(frozen=True, slots=True)
class Piece:
    """One upright box."""

    x: float
    y: float
    yaw: float
    """rad, of its width."""
    width: float
    depth: float
    height: float

    @property
    def corners(self) -> Points:
        """(4, 2) m, round the outline."""
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [self.width / 2, self.depth / 2]
        corners: Points = half @ rotation_matrix(self.yaw).T + [self.x, self.y]
        return corners

    @property
    def sides(self) -> FloatArray:
        """(4, 2, 2) m."""
        corners = self.corners
        return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)

    def distances(self, points: Points) -> FloatArray:
        """(N,) m from the (N, 2) points to the piece; 0 inside."""
        local = np.abs((points.reshape(-1, 2) - [self.x, self.y]) @ rotation_matrix(self.yaw))
        beyond = np.maximum(local - [self.width / 2, self.depth / 2], 0.0)
        distances: FloatArray = np.linalg.norm(beyond, axis=-1)
        return distances


def draw_size(rng: np.random.Generator, kind: str) -> tuple[float, float, float]:
    """Width, depth, height in m of one of its kind."""
    width, depth, height = np.array(KINDS[kind]) * rng.uniform(0.92, 1.04, 3)
    return float(min(width, 2.0)), float(min(depth, 2.0)), float(min(height, 2.0))


def against(room: Space, side: str, share: float, size: tuple[float, float, float]) -> Piece:
    """A piece with its back to a side of the room, `share` (0-1) of the way along it."""
    width, depth, height = size
    face = room.face(side)
    along = width / 2 + 0.03 + share * (face.length - width - 0.06)
    x, y = (float(v) for v in face.at(along, depth / 2 + 0.03))
    return Piece(x, y, float(np.arctan2(face.along[1], face.along[0])), width, depth, height)


def standing(
    room: Space, across: float, up: float, turn: float, size: tuple[float, float, float]
) -> Piece:
    """A piece away from the walls, its middle at shares (0-1) of the room, `turn` rad from its direction."""
    return Piece(*room.at(across, up), room.yaw + turn, *size)


def keep_clear(
    groups: Sequence[Sequence[Piece]],
    plan: Plan,
    stations: Points,
    stands: Points,
    sights: FloatArray,
) -> list[Piece]:
    """The pieces that do not disturb, first come first served.

    Args:
        groups: pieces that stay or go together (the same one in rooms meant to be equal).
        plan: walls and doors to keep clear of.
        stations: (S, 2) m, tripods.
        stands: (T, 2) m, anchors on stands.
        sights: (N, 2, 2) m, between stations that must see each other.
    """
    kept: list[Piece] = []
    for group in groups:
        if all(_disturbs_nothing(piece, kept, plan, stations, stands, sights) for piece in group):
            kept += group
    return kept


def _disturbs_nothing(
    piece: Piece,
    others: Sequence[Piece],
    plan: Plan,
    stations: Points,
    stands: Points,
    sights: FloatArray,
) -> bool:
    sides = piece.sides
    if not clear_paths(sides[:, 0], sides[:, 1], plan.faces).all():
        return False
    if (piece.distances(stations) < _STATION_CLEARANCE).any() or (
        piece.distances(stands) < 0.25
    ).any():
        return False
    if (piece.distances(plan.doors) < _DOOR_CLEARANCE).any():
        return False
    if (
        piece.height > _TALL
        and np.isfinite(crossing_fractions(sights[:, 0], sights[:, 1], sides)).any()
    ):
        return False
    # Two pieces of under 2 x 2 m whose middles are 3 m apart cannot touch.
    near = (other for other in others if np.hypot(other.x - piece.x, other.y - piece.y) < 3.0)
    return not any(_overlap(piece, other) for other in near)


def _overlap(a: Piece, b: Piece) -> bool:
    """True where outlines cross or one stands inside the other."""
    if np.isfinite(crossing_fractions(a.sides[:, 0], a.sides[:, 1], b.sides)).any():
        return True
    return bool(
        b.distances(np.array([a.x, a.y]))[0] == 0.0 or a.distances(np.array([b.x, b.y]))[0] == 0.0
    )
