"""Signs, lines and shapes of the report's map, in the picture's own units: centimetres, y downwards."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model.floor import FloorMap, FloorPlan
from ..model.geometry import FloatArray, Points
from .room_names import roomiest_place

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

UNITS_A_METRE = 100.0
_FREE, _UNKNOWN, _WALL = 255, 226, 30
_GIVEN = (0, 114, 178)
"""Blue of Okabe and Ito: lines of a picture that somebody else drew."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A sign of constant size on the screen, with its name beside it."""

    key: str
    """`station:s01`: ties the mark to its table row and links."""
    x: float
    y: float
    kind: str
    """CSS class: `station`, `anchor`, `other`, `plan`; `doubtful` with it where it is not ok."""
    tip: str
    name: str = ""
    turn: float | None = None
    """Degrees clockwise of the heading; None where there is none."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line between two places."""

    keys: str
    kind: str
    x1: float
    y1: float
    x2: float
    y2: float
    tip: str


@dataclass(frozen=True, slots=True)
class Oval:
    """An ellipse of two sigmas."""

    kind: str
    x: float
    y: float
    rx: float
    ry: float
    turn: float
    """Degrees clockwise."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A room, wall or door."""

    path: str
    tip: str
    width: float = 0.0
    """Picture units; 0 for what has none of its own."""
    name: str = ""
    x: float = 0.0
    y: float = 0.0
    """Where the name stands."""


@dataclass(frozen=True, slots=True)
class Picture:
    """The floor map as an image that is stretched over a rectangle."""

    data: str
    x: float
    y: float
    width: float
    height: float


def to_picture(place: FloatArray) -> tuple[float, float]:
    """Picture units of a place (2,) m."""
    return round(float(place[0]) * UNITS_A_METRE, 2), round(-float(place[1]) * UNITS_A_METRE, 2)


def draw_floor(floor_map: FloorMap) -> Picture | None:
    """The occupancy grid as PNG in a data address: unknown grey, free white, walls dark."""
    from PIL import Image

    if not floor_map.occupancy.size:
        return None
    dark = np.clip(2.0 * np.nan_to_num(floor_map.occupancy) - 1.0, 0.0, 1.0)
    grey = np.where(np.isnan(floor_map.occupancy), _UNKNOWN, _FREE + (_WALL - _FREE) * dark)
    return _stretched(Image.fromarray(np.flipud(grey).astype(np.uint8)), floor_map)


def draw_given(picture: FloorMap) -> Picture:
    """The picture that the frame was aligned to: its lines coloured, its paper transparent."""
    from PIL import Image

    dark = np.flipud(picture.occupancy)[..., None]
    coloured = np.concatenate([np.broadcast_to(_GIVEN, (*dark.shape[:2], 3)), 255.0 * dark], axis=2)
    return _stretched(Image.fromarray(coloured.astype(np.uint8)), picture)


def _stretched(image: PillowImage, floor_map: FloorMap) -> Picture:
    """The image as PNG in a data address, over the rectangle of the map."""
    stream = io.BytesIO()
    image.save(stream, format="PNG")
    height, width = floor_map.occupancy.shape
    cell = floor_map.resolution * UNITS_A_METRE
    x, y = to_picture(np.array(floor_map.origin))
    data = "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
    return Picture(data, x, round(y - height * cell, 2), width * cell, height * cell)


def room_shapes(plan: FloorPlan | None, others: Points) -> Iterable[Shape]:
    """Rooms with their areas, written where none of the other places (M, 2) m is near."""
    for number, room in enumerate(plan.rooms if plan else (), 1):
        x, y = to_picture(roomiest_place(room.polygon, others))
        area = f"{room.area:.1f} m²"
        yield Shape(_path(room.polygon) + "Z", f"room {number}\n{area}", name=area, x=x, y=y)


def wall_shapes(plan: FloorPlan | None) -> Iterable[Shape]:
    """Walls as thick as they are."""
    for wall in plan.walls if plan else ():
        length = float(np.linalg.norm(wall.ends[1] - wall.ends[0]))
        thick = math.isfinite(wall.thickness)
        tip = f"wall {length:.2f} m" + (f"\n{100.0 * wall.thickness:.0f} cm thick" if thick else "")
        yield Shape(
            _path(wall.ends), tip, round(UNITS_A_METRE * wall.thickness, 1) if thick else 2.0
        )


def door_shapes(plan: FloorPlan | None) -> Iterable[Shape]:
    """Doors from jamb to jamb."""
    for door in plan.doors if plan else ():
        width = float(np.linalg.norm(door[1] - door[0]))
        yield Shape(_path(door), f"door or opening {width:.2f} m")


def _path(places: FloatArray) -> str:
    """SVG path through places (N, 2) m."""
    return "M" + "L".join("{} {}".format(*to_picture(place)) for place in places)
