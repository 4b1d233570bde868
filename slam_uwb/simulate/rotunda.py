"""A round hall with niches and pillars, and the rooms and the passage that open onto it."""

from __future__ import annotations

import numpy as np

from ..model.geometry import Points, Vector2, rotation_matrix
from .assembly import Furnishing, Mounting, assemble, draw_furniture
from .placing import place_stations
from .plan import DOOR
from .polygon_plan import build_polygon_plan
from .scene import Scene

_SIDES = 26
"""Of the round wall, before some give way to niches and wide openings."""
_STEP = 2.0 * np.pi / _SIDES
_EAST, _WEST, _PASSAGE, _BROAD, _NARROW = _STEP * np.array([0.0, 11.0, 20.5, 5.5, 17.0])
"""rad, where rooms, passage and both niches open, as seen from the middle of the hall."""
_HALL = (
    "-".join(f"r{k}" for k in range(5)) + "-n1-n2-"
    + "-".join(f"r{k}" for k in range(6, 17)) + "-o1-o2-"
    + "-".join(f"r{k}" for k in range(17, _SIDES) if k != 20)
)  # fmt: skip
"""Niches stand for r5 and the side from r16 to r17; the passage is as wide as the two sides that met at r20."""
_LOOPS = (
    _HALL, "r23-e1-e2-r2-r1-r0-r25-r24", "r8-w1-w2-r13-r12-r11-r10-r9", "r19-p1-p2-r21",
    "s2-s3-s4-p2-p1-s1",
)  # fmt: skip
"""Hall, east and west room, passage, and the room at its end."""
_DOORS = {
    "r25-r0": (0.5, 1.0), "r10-r11": (0.5, 1.0), "r19-r21": (0.5, 1.4), "p1-p2": (0.5, DOOR),
}  # fmt: skip
_CONTENTS: tuple[tuple[Furnishing, ...], ...] = (
    (("cupboard", "n1-n2", 0.5), ("plant", "o1-o2", 0.5), ("table", (0.62, 0.75)), ("plant", "r22-r23", 0.5),
    ("screen", (0.3, 0.45))),
    (("desk", "e1-e2", 0.9), ("cupboard", "e1-e2", 0.1), ("bookshelf", "r23-e1", 0.4)),
    (("wardrobe", "w1-w2", 0.3), ("desk", "w2-r13", 0.7), ("plant", "r8-w1", 0.9)),
    (),
    (("desk", "s2-s3", 0.2), ("cupboard", "s3-s4", 0.4), ("table", (0.7, 0.6)), ("bookshelf", "s1-s2", 0.8),
    ("plant", "s2-s3", 1.0)),
)  # fmt: skip
_MOUNTINGS: tuple[Mounting, ...] = (
    (1, "e1-e2", 0.45), (2, "w1-w2", 0.8), (4, "s2-s3", 0.7), (0, "n1-n2", 0.2), (0, (0.3, 0.25)),
)  # fmt: skip


def rotunda(rng: np.random.Generator) -> Scene:
    """A hall of 9 m diameter, two rooms on it and one at the end of a passage, 11 stations, 5 anchors."""
    radius = float(rng.uniform(4.4, 4.8))
    plan = build_polygon_plan(
        _corners(rng, radius), _LOOPS, _DOORS, float(rng.uniform(0.10, 0.15)), _pillars(rng, radius)
    )
    east, west, way, end = plan.doors
    wanted = [
        east + _seen(_EAST, 1.2, 1.4), east + _seen(_EAST, 1.0), east - _seen(_EAST, 1.0),
        np.array([1.0, 0.1]), np.array([-1.0, 0.7]), west - _seen(_WEST, 1.0),
        west + _seen(_WEST, 1.0), west + _seen(_WEST, 1.3, -1.4), way - _seen(_PASSAGE, 1.7),
        (way + end) / 2, end + _seen(_PASSAGE, 1.1),
    ]  # fmt: skip
    sequence = [
        (0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (3, 8), (8, 9), (9, 10),
    ]  # fmt: skip
    places = [(float(x), float(y)) for x, y in wanted]
    stations = place_stations(rng, plan, places, sequence, jitter=0.15)
    pairs = zip(plan.rooms, _CONTENTS, strict=True)
    furniture = [group for room, content in pairs for group in draw_furniture(rng, [room], content)]
    return assemble(rng, "rotunda", plan, stations, sequence, _MOUNTINGS, furniture)


def _seen(towards: float, out: float, aside: float = 0.0) -> Vector2:
    """(2,) m, `out` in the direction `towards` (rad) and `aside` to the left of it."""
    place: Vector2 = rotation_matrix(towards) @ [out, aside]
    return place


def _corners(rng: np.random.Generator, radius: float) -> dict[str, Vector2]:
    """Where the walls' centre lines meet; the hall's middle is the origin."""
    corners = {f"r{k}": _seen((k + 0.5) * _STEP, radius) for k in range(_SIDES)}
    broad, narrow = _seen(_BROAD, 0.7), _seen(_NARROW, 0.5)
    corners |= {"n1": corners["r4"] + broad, "n2": corners["r6"] + broad}
    corners |= {"o1": corners["r16"] + narrow, "o2": corners["r17"] + narrow}
    # Both rooms are as wide as five sides of the hall.
    half = radius * np.sin(2.5 * _STEP)
    for name, towards in (("e", _EAST), ("w", _WEST)):
        back = radius + rng.uniform(2.6, 3.2)
        corners |= {
            f"{name}{k}": _seen(towards, back, side * half) for k, side in ((1, -1), (2, 1))
        }
    near = radius + rng.uniform(1.6, 2.0)
    far, half = near + rng.uniform(3.3, 3.8), radius * np.sin(_STEP)
    left, right = rng.uniform(1.9, 2.4, 2)
    corners |= {"p1": _seen(_PASSAGE, near, -half), "p2": _seen(_PASSAGE, near, half)}
    corners |= {"s1": _seen(_PASSAGE, near, -right), "s2": _seen(_PASSAGE, far, -right)}
    return corners | {"s3": _seen(_PASSAGE, far, left), "s4": _seen(_PASSAGE, near, left)}


def _pillars(rng: np.random.Generator, radius: float) -> list[Points]:
    """Three octagons, not evenly spaced: a turn of the hall is not the hall."""
    round_ = np.arange(8.0) * np.pi / 4
    outline = 0.24 * np.stack([np.cos(round_), np.sin(round_)], axis=-1)
    directions = np.deg2rad([40.0, 205.0, 310.0] + rng.uniform(-5.0, 5.0, 3))
    return [outline + _seen(towards, 0.62 * radius) for towards in directions]
