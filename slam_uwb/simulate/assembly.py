"""Plan, stations, anchors and furniture -> one scene that keeps the paper's conditions."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TypeAlias

import numpy as np

from ..model.geometry import FloatArray, Points
from .furniture import Piece, against, draw_size, keep_clear, standing
from .placing import NoPlaceError, anchor_on_tripod, anchor_on_wall
from .plan import Plan, Space
from .scene import Scene

Furnishing: TypeAlias = tuple[str, str, float] | tuple[str, tuple[float, float]]
"""Kind, wall and share along it; or kind and the shares of the room where it stands free."""
Mounting: TypeAlias = tuple[int, str, float] | tuple[int, tuple[float, float]]
"""Room, walls ("n e": the east one if the north one has no place) and share along it; or room and the
shares of it where the anchor's stand is."""


def draw_furniture(
    rng: np.random.Generator,
    rooms: Sequence[Space],
    furnishings: Sequence[Furnishing],
    jitter: float = 0.06,
) -> list[list[Piece]]:
    """One group a furnishing: the same piece at the same place of each of the rooms."""
    groups = []
    for furnishing in furnishings:
        size, (dx, dy), turn = (
            draw_size(rng, furnishing[0]),
            rng.uniform(-jitter, jitter, 2),
            rng.normal(0.0, 0.05),
        )
        groups.append([_furnish(room, furnishing, size, dx, dy, turn) for room in rooms])
    return groups


def assemble(
    rng: np.random.Generator,
    name: str,
    plan: Plan,
    stations: Points,
    sequence: Sequence[tuple[int, int]],
    mountings: Sequence[Mounting],
    groups: Sequence[Sequence[Piece]],
) -> Scene:
    """Mount the anchors, leave out the furniture that stands in the way and put all together."""
    anchors = np.array([_place_anchor(rng, plan, mounting, stations) for mounting in mountings])
    stands = anchors[[len(mounting) == 2 for mounting in mountings], :2]
    pieces = keep_clear(groups, plan, stations, stands, stations[np.array(sequence)])
    sides = [piece.sides for piece in pieces]
    return Scene(
        name=name,
        walls=plan.faces,
        partitions=plan.partitions,
        stations=stations,
        anchors=anchors,
        sequence=tuple(sequence),
        furniture=np.concatenate([np.empty((0, 2, 2)), *sides]),
        furniture_heights=np.repeat([piece.height for piece in pieces], 4),
        lintels=plan.lintels,
        rooms=tuple(room.polygon for room in plan.rooms),
    )


def _place_anchor(
    rng: np.random.Generator, plan: Plan, mounting: Mounting, stations: Points
) -> FloatArray:
    if len(mounting) == 2:
        room, (across, up) = mounting
        return anchor_on_tripod(rng, plan, plan.rooms[room], across, up, stations)
    room, sides, share = mounting
    *others, last = sides.split()
    for side in others:
        with suppress(NoPlaceError):
            return anchor_on_wall(rng, plan, plan.rooms[room], side, share)
    return anchor_on_wall(rng, plan, plan.rooms[room], last, share)


def _furnish(
    room: Space,
    furnishing: Furnishing,
    size: tuple[float, float, float],
    dx: float,
    dy: float,
    turn: float,
) -> Piece:
    if len(furnishing) == 3:
        _, side, share = furnishing
        return against(room, side, float(np.clip(share + dx, 0.0, 1.0)), size)
    _, (across, up) = furnishing
    return standing(room, across + dx, up + dy, turn, size)
