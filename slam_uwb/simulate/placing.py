"""Where a careful operator puts tripod and anchors in an empty building; furniture then keeps clear of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2
from .plan import DOOR, Plan, Space
from .segments import BoolArray, clear_paths, distances_to_segments, segments_near

CLEARANCE = 0.45
"""m between tripod and walls: its legs need 0.4."""
NEAREST, FURTHEST = 0.9, 3.0
"""m between consecutive stations: the paper asks for moderate distances, some 3 m apart needed fitting by hand."""
_TRIES = 400


class NoPlaceError(Exception):
    """This drawing of the site leaves no room for a station or anchor; another one will."""


def place_stations(
    rng: np.random.Generator,
    plan: Plan,
    wanted: Sequence[tuple[float, float]],
    sequence: Sequence[tuple[int, int]],
    jitter: float = 0.25,
) -> Points:
    """(S, 2) m near the `wanted` places, each in view of the one that its scan is to be fitted to.

    The jitter grows with every try, so that a place that does not suit is left no further than needed.
    """
    before = {n: m for m, n in sequence}
    placed: list[Vector2] = []
    for n, (x, y) in enumerate(wanted):
        reach = jitter * np.linspace(1.0, 3.0, _TRIES)[:, None]
        candidates = np.array([x, y]) + reach * rng.uniform(-1.0, 1.0, (_TRIES, 2))
        same_room = _in_view(np.array([x, y]), candidates, plan)
        placed.append(
            first_place(plan, candidates[same_room], placed, placed[before[n]] if n else None)
        )
    return np.array(placed)


def first_place(
    plan: Plan, candidates: Points, placed: Sequence[Vector2], previous: Vector2 | None
) -> Vector2:
    """The first of the (N, 2) candidates clear of walls and stations, and in view of the `previous` station."""
    if not len(candidates):
        raise NoPlaceError
    good = _clear_of_walls(candidates, plan, CLEARANCE)
    if previous is not None:
        steps = np.linalg.norm(candidates[:, None] - np.array(placed), axis=-1)
        good &= steps.min(axis=1) >= NEAREST
        good &= np.linalg.norm(candidates - previous, axis=-1) <= FURTHEST
        good &= _in_view(previous, candidates, plan)
    if not good.any():
        raise NoPlaceError
    chosen: Vector2 = candidates[np.argmax(good)]
    return chosen


def anchor_on_wall(
    rng: np.random.Generator, plan: Plan, room: Space, side: str, share: float, jitter: float = 0.3
) -> FloatArray:
    """(3,) m, an anchor fixed to a wall of the room, under the ceiling; not over a door nor inside a column.

    Args:
        rng: for the place along the wall and the height.
        plan: doors and columns.
        room: whose wall.
        side: of the room.
        share: 0-1 of the way along the wall.
        jitter: m along the wall.
    """
    face = room.face(side)
    aside = rng.uniform(-jitter, jitter, _TRIES) * np.linspace(1.0, 3.0, _TRIES)
    places = face.at(np.clip(share * face.length + aside, 0.1, face.length - 0.1), 0.06)
    good = _in_view(room.middle, places, plan)
    good &= _far_from(places, plan.doors, DOOR / 2 + 0.2)
    return _with_height(places, good, rng.uniform(2.1, 2.6))


def anchor_on_tripod(
    rng: np.random.Generator,
    plan: Plan,
    room: Space,
    across: float,
    up: float,
    stations: Points,
    jitter: float = 0.3,
) -> FloatArray:
    """(3,) m, an anchor on a stand of its own near the shares `across` and `up` of the room."""
    reach = jitter * np.linspace(1.0, 4.0, _TRIES)[:, None]
    places = np.array(room.at(across, up)) + reach * rng.uniform(-1.0, 1.0, (_TRIES, 2))
    good = _in_view(room.middle, places, plan)
    good &= _clear_of_walls(places, plan, 0.4)
    good &= _far_from(places, plan.doors, DOOR) & _far_from(places, stations, 0.6)
    return _with_height(places, good, rng.uniform(1.9, 2.2))


def _in_view(place: Vector2, others: Points, plan: Plan) -> BoolArray:
    """(N,) True where no wall stands between the (2,) place and each of the (N, 2) others."""
    near = segments_near(plan.faces, np.vstack([others, place]))
    return clear_paths(np.broadcast_to(place, others.shape), others, near)


def _clear_of_walls(places: Points, plan: Plan, clearance: float) -> BoolArray:
    near = segments_near(plan.faces, places, clearance)
    gaps = distances_to_segments(places, near)
    return np.asarray((gaps >= clearance).all(axis=1), dtype=np.bool_)


def _far_from(places: Points, others: Points, distance: float) -> BoolArray:
    gaps: FloatArray = np.linalg.norm(places[:, None] - others.reshape(-1, 2), axis=-1)
    return np.asarray((gaps >= distance).all(axis=1), dtype=np.bool_)


def _with_height(places: Points, good: BoolArray, height: float) -> FloatArray:
    """The first good place; heights are measured by hand, to the centimetre."""
    if not good.any():
        raise NoPlaceError
    return np.array([*places[np.argmax(good)], round(height, 2)])
