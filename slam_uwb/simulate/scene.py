"""One site as it truly is: walls, furniture, and where tripod and anchors stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ..model.geometry import FloatArray, Points, frozen_array
from ..model.survey import AnchorId, StationId


def _no_segments() -> FloatArray:
    return np.empty((0, 2, 2))


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A furnished floor in the plan's frame; walls reach from floor to ceiling, furniture up to its height."""

    name: str
    walls: FloatArray
    """(W, 2, 2) m, the visible faces: two rooms see different faces of the wall between them."""
    partitions: FloatArray
    """(P, 2, 2) m, centre lines between the openings: what a radio path crosses, once a wall."""
    stations: Points
    """(S, 2) m, in the order of the visit."""
    anchors: FloatArray
    """(A, 3) m, the antennas."""
    sequence: tuple[tuple[int, int], ...]
    """(m, n): the scan of station n is to be fitted to that of m; every station but the first is an n once."""
    furniture: FloatArray = field(default_factory=_no_segments)
    """(F, 2, 2) m, the sides of all pieces."""
    furniture_heights: FloatArray = field(default_factory=lambda: np.empty(0))
    """(F,) m, of the piece that the side belongs to."""
    lintels: FloatArray = field(default_factory=_no_segments)
    """(L, 2, 2) m, wall faces over the doors: a scan above `door_height` sees closed rooms."""
    rooms: tuple[Points, ...] = ()
    """One (V, 2) m polygon a room, inner faces, corridors included."""
    door_height: float = 2.1
    """m."""

    def __post_init__(self) -> None:
        sides = (None, 2, 2)
        shapes: dict[str, tuple[int | None, ...]] = {
            "walls": sides, "partitions": sides, "stations": (None, 2), "anchors": (None, 3),
            "furniture": sides, "furniture_heights": (len(self.furniture),), "lintels": sides,
        }  # fmt: skip
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen_array(getattr(self, name), shape, name))
        rooms = tuple(frozen_array(room, (None, 2), "room") for room in self.rooms)
        object.__setattr__(self, "rooms", rooms)
        reached = {0}
        for m, n in self.sequence:
            if m not in reached or n in reached:
                raise ValueError(f"sequence pair ({m}, {n}): m must be reached before, n must not")
            reached.add(n)
        if reached != set(range(len(self.stations))):
            raise ValueError(
                f"the sequence reaches {sorted(reached)}, there are {len(self.stations)} stations"
            )

    def faces_at(self, height: float) -> FloatArray:
        """(N, 2, 2) m, everything that a scanner at `height` m can see."""
        tall = self.furniture[self.furniture_heights > height]
        return np.concatenate(
            [self.walls, tall, self.lintels] if height > self.door_height else [self.walls, tall]
        )

    @property
    def station_ids(self) -> tuple[StationId, ...]:
        """s01, s02, ... in the order of `stations`."""
        return tuple(StationId(f"s{k + 1:02d}") for k in range(len(self.stations)))

    @property
    def anchor_ids(self) -> tuple[AnchorId, ...]:
        """A1, A2, ... in the order of `anchors`."""
        return tuple(AnchorId(f"A{k + 1}") for k in range(len(self.anchors)))


SceneBuilder: TypeAlias = Callable[[np.random.Generator], Scene]
"""Draws one site of a kind."""
