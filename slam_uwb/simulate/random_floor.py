"""Office floors of any size: wings of rooms on both sides of a corridor, joined by a cross corridor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..model.geometry import Points, Vector2
from .assembly import Furnishing, Mounting, assemble, draw_furniture
from .furniture import KINDS
from .placing import first_place
from .plan import DOOR, OUTER, Plan, Room, Wall, build_plan
from .scene import Scene

MAX_ROOMS = 400
"""Such a floor has some 1,200 stations."""
_WING_ROOMS = 10
_SPINE = 2.4
"""m, width of the cross corridor."""
_STEP = 2.7
"""m between stations along a corridor, jitter aside."""


@dataclass(frozen=True, slots=True)
class _Office:
    """A room on a corridor and its door."""

    room: Room
    door: float
    """m, x of its middle."""
    up: bool
    """True where the room lies above (larger y than) its corridor."""


@dataclass(frozen=True, slots=True)
class _Wing:
    low: float
    """m, y of the corridor's lower side."""
    high: float
    """m, y of its upper side."""
    top: float
    """m, y of the wing's upper end."""
    offices: tuple[_Office, ...]

    @property
    def aisle(self) -> float:
        """m, y of the corridor's middle."""
        return (self.low + self.high) / 2


def random_floor(rng: np.random.Generator, rooms: int) -> Scene:
    """A floor of `rooms` offices of random sizes, about 3 stations and 0.8 anchors a room."""
    plan, wings = _build(rng, rooms)
    stations, sequence = _Visit(rng, plan).all_wings(wings)
    mountings = _mountings(rng, plan, rooms)
    groups = [
        group
        for wing in wings
        for office in wing.offices
        for group in draw_furniture(rng, [office.room], _contents(rng, office.room))
    ]
    return assemble(rng, f"random-floor-{rooms}", plan, stations, sequence, mountings, groups)


def _build(rng: np.random.Generator, rooms: int) -> tuple[Plan, list[_Wing]]:
    """Wings one above the other, all of one length; the cross corridor lies at negative x."""
    count = -(-rooms // _WING_ROOMS)
    shares = [len(part) for part in np.array_split(np.arange(rooms), count)]
    length = -(-max(shares) // 2) * float(rng.uniform(4.0, 4.8))
    inner = float(rng.uniform(0.10, 0.15))
    wings: list[_Wing] = []
    for share in shares:
        wings.append(_wing(rng, share, length, wings[-1].top if wings else 0.0))
    box = Room(-_SPINE if count > 1 else 0.0, 0.0, length, wings[-1].top)
    walls = _shell(box) + [wall for wing in wings for wall in _wing_walls(wing, length, inner)]
    walls += [Wall((0.0, wing.top), (length, wing.top), inner) for wing in wings[:-1]]
    corridors = [Room(0.0, wing.low, length, wing.high) for wing in wings]
    if count > 1:
        openings = tuple(
            ((wing.low + wing.high) / 2, wing.high - wing.low - inner) for wing in wings
        )
        walls.append(Wall((0.0, 0.0), (0.0, box.y1), inner, openings))
        # Each corridor's floor goes on through its opening.
        corridors = [replace(room, x0=-inner) for room in corridors]
        corridors.append(Room(box.x0, 0.0, 0.0, box.y1))
    wings = [replace(wing, offices=_inside_offices(wing.offices, box, inner)) for wing in wings]
    offices = [office.room for wing in wings for office in wing.offices]
    return build_plan(walls, offices + [_inside(room, box, inner) for room in corridors]), wings


def _wing(rng: np.random.Generator, rooms: int, length: float, bottom: float) -> _Wing:
    """Rooms below and above a corridor, the odd one above; between centre lines."""
    below = rooms // 2
    low = bottom + (float(rng.uniform(3.6, 5.6)) if below else 0.0)
    high = low + float(rng.uniform(1.9, 2.4))
    top = high + float(rng.uniform(3.6, 5.6))
    offices = _row(rng, below, (bottom, low), length, up=False) + _row(
        rng, rooms - below, (high, top), length, up=True
    )
    return _Wing(low, high, top, tuple(offices))


def _row(
    rng: np.random.Generator, count: int, span: tuple[float, float], length: float, *, up: bool
) -> list[_Office]:
    """`count` rooms side by side between the two y of `span`."""
    widths = rng.uniform(0.75, 1.3, count)
    edges = [0.0, *(float(x) for x in np.cumsum(widths / widths.sum() * length))]
    return [
        _Office(Room(a, span[0], b, span[1]), float(rng.uniform(a + 1.1, b - 1.1)), up)
        for a, b in pairwise(edges)
    ]


def _wing_walls(wing: _Wing, length: float, inner: float) -> list[Wall]:
    """Both sides of the corridor and what divides the rooms."""
    walls = []
    for up, front in ((False, wing.low), (True, wing.high)):
        row = [office for office in wing.offices if office.up == up]
        if row:
            doors = tuple((office.door, DOOR) for office in row)
            walls.append(Wall((0.0, front), (length, front), inner, doors))
        walls += [Wall((o.room.x0, o.room.y0), (o.room.x0, o.room.y1), inner) for o in row[1:]]
    return walls


def _shell(box: Room) -> list[Wall]:
    corners = [(box.x0, box.y0), (box.x1, box.y0), (box.x0, box.y1), (box.x1, box.y1)]
    return [Wall(corners[a], corners[b], OUTER) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]


def _inside(room: Room, box: Room, inner: float) -> Room:
    """From centre lines to faces: the outer walls are thicker."""

    def half(coordinate: float, outer: float) -> float:
        return (OUTER if coordinate == outer else inner) / 2

    return Room(
        room.x0 + half(room.x0, box.x0), room.y0 + half(room.y0, box.y0),
        room.x1 - half(room.x1, box.x1), room.y1 - half(room.y1, box.y1),
    )  # fmt: skip


def _inside_offices(offices: Sequence[_Office], box: Room, inner: float) -> tuple[_Office, ...]:
    return tuple(replace(office, room=_inside(office.room, box, inner)) for office in offices)


class _Visit:
    """The operator's walk: places chosen one after the other, each in view of an earlier one."""

    def __init__(self, rng: np.random.Generator, plan: Plan) -> None:
        self._rng = rng
        self._plan = plan
        self._placed: list[Vector2] = []
        self._sequence: list[tuple[int, int]] = []

    def all_wings(self, wings: Sequence[_Wing]) -> tuple[Points, list[tuple[int, int]]]:
        """Up the cross corridor, and into every wing on the way."""
        here: int | None = None
        for k, wing in enumerate(wings):
            if len(wings) > 1:
                previous = wings[k - 1].aisle if k else wing.aisle - _STEP
                for y in np.linspace(previous, wing.aisle, 1 + _steps(wing.aisle - previous))[1:]:
                    here = self._go((-_SPINE / 2, float(y)), here)
            self._wing(wing, here)
        return np.array(self._placed), self._sequence

    def _wing(self, wing: _Wing, here: int | None) -> None:
        """Along the corridor, stopping where a door is opposite, and into each room."""
        waiting = sorted(wing.offices, key=lambda office: office.door)
        x = float(self._placed[here][0]) if here is not None else None
        while waiting:
            target = waiting[0].door
            stop = target if x is None else x + (target - x) / _steps(target - x)
            here = self._go((float(stop), wing.aisle), here)
            x = float(self._placed[here][0])
            reached = [office for office in waiting if abs(office.door - x) < 0.9]
            for office in reached:
                self._room(office, wing, here)
                waiting.remove(office)

    def _room(self, office: _Office, wing: _Wing, corridor: int) -> None:
        inside = self._go((office.door, wing.high + 1.1 if office.up else wing.low - 1.1), corridor)
        room = office.room
        area = (room.x1 - room.x0) * (room.y1 - room.y0)
        for _ in range(int(area > 17.0) + int(area > 27.0)):
            self._anywhere(room, inside)

    def _go(self, wanted: tuple[float, float], previous: int | None) -> int:
        """Near a wanted place, further from it with every try."""
        tries = 400
        reach = np.linspace(0.2, 0.6, tries)[:, None]
        return self._stand(
            np.array(wanted) + reach * self._rng.uniform(-1.0, 1.0, (tries, 2)), previous
        )

    def _anywhere(self, room: Room, previous: int) -> int:
        tries = 400
        return self._stand(
            self._rng.uniform([room.x0, room.y0], [room.x1, room.y1], (tries, 2)), previous
        )

    def _stand(self, candidates: Points, previous: int | None) -> int:
        last = None if previous is None else self._placed[previous]
        self._placed.append(first_place(self._plan, candidates, self._placed, last))
        if previous is not None:
            self._sequence.append((previous, len(self._placed) - 1))
        return len(self._placed) - 1


def _steps(distance: float) -> int:
    return max(1, int(np.ceil(abs(distance) / _STEP)))


def _mountings(rng: np.random.Generator, plan: Plan, rooms: int) -> list[Mounting]:
    """One anchor in four rooms of five, every sixth in a corridor instead, every fifth on a stand."""
    count = max(3, round(0.8 * rooms))
    offices = rng.permutation(rooms)
    chosen: list[Mounting] = []
    for k in range(count):
        room = int(rng.integers(rooms, len(plan.rooms))) if k % 6 == 5 else int(offices[k % rooms])
        if k % 5 == 3:
            chosen.append((room, (float(rng.uniform(0.25, 0.75)), float(rng.uniform(0.25, 0.75)))))
        else:
            # On a large floor some wall is all doors: then another wall of that room, not another floor.
            wall = str(rng.choice(["n", "e", "s", "w"]))
            walls = " ".join([wall, *"nesw".replace(wall, "")])
            chosen.append((room, walls, float(rng.uniform(0.1, 0.9))))
    return chosen


def _contents(rng: np.random.Generator, room: Room) -> list[Furnishing]:
    """Some furniture by floor area, along random walls."""
    area = (room.x1 - room.x0) * (room.y1 - room.y0)
    kinds = [kind for kind in KINDS if kind not in ("bed", "fridge", "screen")]
    contents: list[Furnishing] = [
        (str(rng.choice(kinds)), str(rng.choice(["n", "e", "s", "w"])), float(rng.uniform()))
        for _ in range(3 + int(area / 4.0))
    ]
    return [*contents, ("screen", (float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.3, 0.7))))]
