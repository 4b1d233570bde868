"""A building with a wing at an oblique angle: hardly two rooms share the direction of their walls."""

from __future__ import annotations

import numpy as np

from ..model.geometry import Vector2, rotation_matrix
from .assembly import Furnishing, Mounting, assemble, draw_furniture
from .placing import place_stations
from .polygon_plan import build_polygon_plan
from .scene import Scene

_LOOPS = ("a-b-q-c-d-e-f-g-h", "h-g-i-j", "a-m-n-b", "g-f-e-k-i", "e-d-l-k", "b-o-p-q")
"""The corridor with its kink from b to f, and the rooms as they are visited: one with a slanted outer wall, a
trapezoid, one in the bend, and two along the wing."""
_DOORS = {"g-h": 0.34, "a-b": 0.52, "e-f": 0.58, "d-e": 0.73, "b-q": 0.7}
"""Share along the corridor's wall, a door for each room."""
_DOOR = 1.05
"""m; a little wider than elsewhere, since scans through a door askew to both rooms share little."""
_CONTENTS: tuple[tuple[Furnishing, ...], ...] = (
    (("plant", "c-d", 0.9), ("cupboard", "q-c", 0.6)),
    (("desk", "i-j", 0.3), ("cupboard", "j-h", 0.2), ("bookshelf", "g-i", 0.6), ("desk", "j-h", 0.85),
    ("plant", "h-g", 0.0), ("cupboard", "g-i", 0.95)),
    (("desk", "m-n", 0.3), ("cupboard", "a-m", 0.4), ("bookshelf", "n-b", 0.45), ("plant", "a-m", 0.9),
    ("table", (0.75, 0.4))),
    (("desk", "i-g", 0.3), ("bookshelf", "e-k", 0.85), ("cupboard", "i-g", 0.75), ("plant", "e-k", 0.15)),
    (("wardrobe", "l-k", 0.8), ("desk", "d-l", 0.5), ("bookshelf", "k-e", 0.2), ("plant", "l-k", 0.1)),
    (("sofa", "o-p", 0.4), ("bookshelf", "p-q", 0.6), ("cupboard", "b-o", 0.5), ("plant", "p-q", 0.1)),
)  # fmt: skip
_MOUNTINGS: tuple[Mounting, ...] = (
    (1, "j-h", 0.5), (2, "m-n", 0.7), (3, "k-i", 0.5), (4, "d-l", 0.8), (5, (0.6, 0.5)),
    (0, "h-a", 0.5),
)  # fmt: skip


def oblique(rng: np.random.Generator) -> Scene:
    """Five rooms of five shapes on a corridor with a kink of 30 to 40 degrees, 12 stations, 6 anchors."""
    corners = _corners(rng)
    doors = {side: (share + rng.uniform(-0.03, 0.03), _DOOR) for side, share in _DOORS.items()}
    plan = build_polygon_plan(corners, _LOOPS, doors, float(rng.uniform(0.10, 0.15)))
    aisle, *rooms = plan.rooms
    slanted, trapezoid, bend, wing, low = (
        door - 0.95 * aisle.face(side).inward for side, door in zip(doors, plan.doors, strict=True)
    )
    kink, ahead = (corners["b"] + corners["f"]) / 2, aisle.face("b-q").along
    wanted = [
        rooms[0].at(0.4, 0.6), slanted, (plan.doors[0] + plan.doors[1]) / 2, trapezoid,
        rooms[1].at(0.6, 0.3), kink + 0.5 * ahead, bend, rooms[2].at(0.4, 0.7),
        kink + 3.1 * ahead, wing, rooms[3].at(0.65, 0.6), low,
    ]  # fmt: skip
    sequence = [
        (0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (5, 6), (6, 7), (5, 8), (8, 9), (9, 10), (8, 11),
    ]  # fmt: skip
    places = [(float(x), float(y)) for x, y in wanted]
    stations = place_stations(rng, plan, places, sequence, jitter=0.2)
    pairs = zip(plan.rooms, _CONTENTS, strict=True)
    furniture = [group for room, content in pairs for group in draw_furniture(rng, [room], content)]
    return assemble(rng, "oblique", plan, stations, sequence, _MOUNTINGS, furniture)


def _corners(rng: np.random.Generator) -> dict[str, Vector2]:
    """Where the walls' centre lines meet; the corridor runs along x up to its kink and then turns left."""
    turn, width = np.deg2rad(rng.uniform(30.0, 40.0)), rng.uniform(1.9, 2.1)
    kink = np.array([5.2 + rng.uniform(-0.15, 0.15), 0.0])
    wing = rotation_matrix(turn).T
    ahead, aside = wing
    left = kink + width * np.array([-np.tan(turn / 2), 1.0])
    bend, end = left + 2.6 * ahead, kink + rng.uniform(6.3, 6.7) * ahead
    depth = rng.uniform(3.2, 3.6)
    corners = {
        "a": np.zeros(2), "b": kink, "q": kink + 4.4 * ahead, "c": end,
        "d": end + width * aside, "e": bend, "f": left,
        "g": np.array([3.7, width]), "h": np.array([0.0, width]), "k": bend + depth * aside,
        "l": end + (width + depth) * aside,
    }  # fmt: skip
    outer = {
        "i": [3.7, width + 4.5], "j": [0.0, width + 3.2], "m": [0.0, -3.1], "n": [4.3, -3.9],
        "o": kink + np.array([0.4, -3.1]) @ wing, "p": kink + np.array([3.7, -3.7]) @ wing,
    }  # fmt: skip
    moved = np.array(list(outer.values())) + rng.uniform(-0.15, 0.15, (len(outer), 2))
    return corners | dict(zip(outer, moved, strict=True))
