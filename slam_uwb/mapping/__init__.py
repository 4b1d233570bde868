"""Scans + poses -> floor map and walls."""

from .occupancy import build_floor_map
from .walls import find_walls

__all__ = ["build_floor_map", "find_walls"]
