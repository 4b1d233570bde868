"""The named sites. Each keeps its character; measures, furniture, stations and anchors vary with the generator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray
from .assembly import Furnishing, Mounting, assemble, draw_furniture
from .placing import place_stations
from .plan import DOOR, INNER, OUTER, Plan, Room, Wall, build_plan
from .scene import Scene

_OFFICE: tuple[Furnishing, ...] = (
    ("desk", "n", 0.05), ("desk", "n", 0.95), ("cupboard", "w", 0.30), ("bookshelf", "e", 0.62),
    ("screen", (0.55, 0.72)), ("desk", "w", 0.72), ("cupboard", "e", 0.05), ("plant", "w", 0.0),
    ("table", (0.5, 0.45)), ("cupboard", "s", 0.05), ("desk", "e", 0.85), ("cupboard", "e", 0.4),
    ("plant", "n", 0.47), ("table", (0.3, 0.3)), ("bookshelf", "w", 0.5),
)  # fmt: skip


def paper_office(rng: np.random.Generator) -> Scene:
    """Three offices in a row on a corridor, 15 x 8 m, 18 stations, 7 anchors (paper, section IV and Fig. 5a)."""
    plan, (aisle, *offices), doors = _office_plan(rng)
    depth, inside, middle = offices[0].y1, aisle.y1 + 1.1, (aisle.y0 + aisle.y1) / 2
    wanted = [
        (1.5, depth - 1.5), (3.6, depth - 2.4), (1.9, inside + 1.3), (doors[0], inside),
        (doors[0], middle), ((doors[0] + doors[1]) / 2, middle), (doors[1], middle),
        (doors[1], inside), (6.4, inside + 1.5), (8.5, inside + 2.3), (6.9, depth - 1.2),
        ((doors[1] + doors[2]) / 2, middle), (doors[2], middle),
        (doors[2], inside), (13.4, inside + 0.8), (11.6, inside + 2.2), (13.3, depth - 1.4),
        (doors[2] + 2.0, middle),
    ]  # fmt: skip
    # A chain, but that the way goes on in front of the second and the third room after each of them.
    branches = {11: 6, 17: 12}
    sequence = [(branches.get(n, n - 1), n) for n in range(1, 18)]
    stations = place_stations(rng, plan, wanted, sequence)
    mountings: list[Mounting] = [
        (1, "w", 0.7), (1, (0.8, 0.45)), (0, "s", 0.12), (2, "n", 0.8), (2, (0.2, 0.25)),
        (3, "e", 0.75), (0, "e", 0.5),
    ]  # fmt: skip
    furniture = [group for room in offices for group in draw_furniture(rng, [room], _OFFICE)]
    furniture += draw_furniture(
        rng, [aisle], [("cupboard", "s", 0.42), ("plant", "n", 0.0), ("bookshelf", "s", 0.8)]
    )
    return assemble(rng, "paper-office", plan, stations, sequence, mountings, furniture)


def flat(rng: np.random.Generator) -> Scene:
    """Living room, kitchen, bedroom and study on a hall, 9 x 8 m, much furniture, 10 stations, 5 anchors."""
    plan, hall, (living, kitchen, bed, study) = _flat_plan(rng)
    low, high = hall.y0, hall.y1
    aisle = (low + high) / 2
    wanted = [
        (1.5, 1.8), (living, 2.3), (living, aisle), (bed - 0.3, high + 1.1), (1.4, high + 1.8),
        (4.8, aisle), (kitchen, aisle), (kitchen, 2.5), (study, high + 1.1),
        (study + 1.2, high + 1.8),
    ]  # fmt: skip
    sequence = [(0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (5, 6), (6, 7), (6, 8), (8, 9)]
    stations = place_stations(rng, plan, wanted, sequence)
    mountings: list[Mounting] = [
        (1, "w", 0.3),
        (2, "e", 0.35),
        (3, "n", 0.2),
        (4, "n", 0.8),
        (0, "e", 0.5),
    ]
    contents: list[list[Furnishing]] = [
        [("cupboard", "e", 0.9), ("plant", "w", 0.9)],
        [("sofa", "s", 0.7), ("bookshelf", "w", 0.9), ("table", (0.55, 0.45)),
        ("cupboard", "e", 0.95), ("plant", "s", 0.2)],
        [("fridge", "e", 0.0), ("cupboard", "e", 0.3), ("table", (0.45, 0.25)),
        ("cupboard", "s", 0.4)],
        [("wardrobe", "e", 0.9), ("bed", "n", 0.55), ("bookshelf", "w", 0.9), ("plant", "s", 0.0)],
        [("desk", "n", 0.3), ("bookshelf", "e", 0.5), ("wardrobe", "w", 0.9), ("plant", "s", 1.0)],
    ]  # fmt: skip
    pairs = zip(plan.rooms, contents, strict=True)
    furniture = [group for room, content in pairs for group in draw_furniture(rng, [room], content)]
    return assemble(rng, "flat", plan, stations, sequence, mountings, furniture)


def corridor(rng: np.random.Generator) -> Scene:
    """Five equal rooms with equal furniture on a 25 m corridor, 14 stations, 8 anchors: aliased on purpose."""
    pitch, hall, depth = 5.0 + float(rng.uniform(-0.1, 0.1)), 2.0, 6.6 + rng.uniform(-0.2, 0.2)
    doors: FloatArray = pitch * (np.arange(5.0) + 0.5) + rng.uniform(-0.3, 0.3)
    inner, length = rng.uniform(0.10, 0.15), 5 * pitch
    half, edge, top = inner / 2, OUTER / 2, depth - OUTER / 2
    back = edge - half
    walls = [
        # The outer walls stand back by what they are thicker: the end rooms are as wide inside as the others.
        *_shell(length + back, depth, -back),
        Wall((-back, hall), (length + back, hall), inner, tuple((float(x), DOOR) for x in doors)),
        *(Wall((pitch * k, hall), (pitch * k, depth), inner) for k in range(1, 5)),
    ]
    offices = [Room(pitch * k + half, hall + half, pitch * (k + 1) - half, top) for k in range(5)]
    plan = build_plan(walls, [Room(half, edge, length - half, hall - half), *offices])
    wanted, sequence = _corridor_visit(doors, pitch, hall)
    stations = place_stations(rng, plan, wanted, sequence, jitter=0.2)
    mountings: list[Mounting] = [
        (1, "n", 0.8), (2, "e", 0.6), (3, "n", 0.25), (4, "w", 0.7), (5, "n", 0.7),
        (0, "s", 0.1), (0, "s", 0.55), (0, "e", 0.5),
    ]  # fmt: skip
    content: list[Furnishing] = [
        ("cupboard", "w", 0.75), ("desk", "n", 0.85), ("bookshelf", "e", 0.35),
        ("desk", "n", 0.1), ("plant", "s", 0.0),
    ]  # fmt: skip
    furniture = draw_furniture(rng, offices, content)
    return assemble(rng, "corridor", plan, stations, sequence, mountings, furniture)


def twin_rooms(rng: np.random.Generator) -> Scene:
    """Two congruent rooms and the door between them, 8 stations, 5 anchors.

    Half a turn about the door maps walls and furniture on themselves: only what is seen through the door, and the
    ranges, tell the rooms apart.
    """
    width, depth = 4.6 + rng.uniform(-0.2, 0.2), 4.4 + rng.uniform(-0.2, 0.2)
    door = depth / 2
    walls = [*_shell(2 * width, depth), Wall((width, 0), (width, depth), INNER, ((door, DOOR),))]
    edge, half = OUTER / 2, INNER / 2
    rooms = [
        Room(edge, edge, width - half, depth - edge),
        Room(width + half, edge, 2 * width - edge, depth - edge),
    ]
    plan: Plan = build_plan(walls, rooms)
    wanted = [
        (1.2, depth - 1.1), (2.7, depth - 1.4), (1.5, 1.3), (width - 1.0, door),
        (width + 1.0, door), (width + 1.4, 1.2), (width + 3.2, 1.3), (width + 3.0, depth - 1.2),
    ]  # fmt: skip
    sequence = [(0, 1), (0, 2), (1, 3), (3, 4), (4, 5), (5, 6), (6, 7)]
    stations = place_stations(rng, plan, wanted, sequence)
    mountings: list[Mounting] = [
        (0, "w", 0.3),
        (0, "n", 0.6),
        (0, "s", 0.8),
        (1, "n", 0.5),
        (1, "e", 0.4),
    ]
    content: list[Furnishing] = [
        ("wardrobe", "n", 0.05), ("desk", "s", 0.5), ("bookshelf", "s", 0.0),
        ("plant", "n", 1.0), ("cupboard", "w", 0.45),
        ("desk", "n", 0.6), ("table", (0.55, 0.3)), ("bookshelf", "w", 0.1),
    ]  # fmt: skip
    furniture = [
        [piece, replace(piece, x=2 * width - piece.x, y=depth - piece.y)]
        for (piece,) in draw_furniture(rng, rooms[:1], content)
    ]
    return assemble(rng, "twin-rooms", plan, stations, sequence, mountings, furniture)


def _office_plan(rng: np.random.Generator) -> tuple[Plan, list[Room], FloatArray]:
    """The plan, its corridor and offices from left to right, and the x of their doors."""
    length, depth = 15.0 + rng.uniform(-0.3, 0.3), 8.0 + rng.uniform(-0.2, 0.2)
    hall, first, second = np.array([2.1, 5.2, 9.8]) + rng.uniform(-1, 1, 3) * [0.08, 0.2, 0.2]
    doors = np.array([3.4, 7.6, 11.6]) + rng.uniform(-0.2, 0.2, 3)
    inner = rng.uniform(0.10, 0.15)
    walls = [
        *_shell(length, depth),
        Wall((0, hall), (length, hall), inner, tuple((float(x), DOOR) for x in doors)),
        Wall((first, hall), (first, depth), inner),
        # One door between two offices closes a loop, which a plain chain of scans never sees.
        Wall((second, hall), (second, depth), inner, ((float(rng.uniform(4.4, 4.9)), DOOR),)),
    ]
    half, edge, top = inner / 2, OUTER / 2, depth - OUTER / 2
    rooms = [
        Room(edge, edge, length - edge, hall - half),
        Room(edge, hall + half, first - half, top),
        Room(first + half, hall + half, second - half, top),
        Room(second + half, hall + half, length - edge, top),
    ]
    columns = [Room(x - 0.2, top - 0.3, x + 0.2, top) for x in (2.6, 7.4, 12.4)]
    return build_plan(walls, rooms, columns), rooms, doors


def _flat_plan(rng: np.random.Generator) -> tuple[Plan, Room, FloatArray]:
    """The plan of hall, living room, kitchen, bedroom, study; the hall; the x of the other four's doors."""
    length, depth = 9.0 + rng.uniform(-0.2, 0.2), 8.0 + rng.uniform(-0.2, 0.2)
    low, high, left, right = np.array([3.6, 5.1, 5.4, 4.7]) + rng.uniform(-0.15, 0.15, 4)
    doors = np.array([3.1, 6.8, 2.9, 6.4]) + rng.uniform(-0.2, 0.2, 4)
    inner = rng.uniform(0.10, 0.15)
    walls = [
        *_shell(length, depth),
        Wall((0, low), (length, low), inner, ((float(doors[0]), 1.3), (float(doors[1]), DOOR))),
        Wall((0, high), (length, high), inner, ((float(doors[2]), DOOR), (float(doors[3]), DOOR))),
        Wall((left, 0), (left, low), inner, ((1.3, 1.1),)),
        Wall((right, high), (right, depth), inner),
    ]
    half, edge, top, end = inner / 2, OUTER / 2, depth - OUTER / 2, length - OUTER / 2
    rooms = [
        Room(edge, low + half, end, high - half),
        Room(edge, edge, left - half, low - half),
        Room(left + half, edge, end, low - half),
        Room(edge, high + half, right - half, top),
        Room(right + half, high + half, end, top),
    ]
    flue = Room(edge, edge, edge + 0.5, edge + 0.35)
    return build_plan(walls, rooms, [flue]), rooms[0], doors


def _shell(end: float, depth: float, start: float = 0.0) -> list[Wall]:
    """Outer walls round (start, 0) to (end, depth), entrance closed."""
    corners = [(start, 0.0), (end, 0.0), (start, depth), (end, depth)]
    return [Wall(corners[a], corners[b], OUTER) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]


def _corridor_visit(
    doors: FloatArray, pitch: float, hall: float
) -> tuple[list[tuple[float, float]], list[tuple[int, int]]]:
    """Along the corridor, with a step into every room: wanted places and the sequence."""
    wanted: list[tuple[float, float]] = []
    sequence: list[tuple[int, int]] = []
    here = 0
    for k, x in enumerate(doors):
        if k:
            wanted.append((float(x) - pitch / 2, hall / 2))
            sequence.append((here, len(wanted) - 1))
            here = len(wanted) - 1
        wanted += [(float(x), hall / 2), (float(x), hall + 1.1)]
        if k:
            sequence.append((here, len(wanted) - 2))
        here = len(wanted) - 2
        sequence.append((here, here + 1))
    return wanted, sequence
