"""Scans + poses -> floor map."""

from .occupancy import build_floor_map

__all__ = ["build_floor_map"]
