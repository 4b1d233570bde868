"""Scans + poses -> floor map, walls, rooms."""

from .floor_plan import build_floor_plan
from .occupancy import build_floor_map
from .walls import find_walls

__all__ = ["build_floor_map", "build_floor_plan", "find_walls"]
