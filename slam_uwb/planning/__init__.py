"""A solution -> where to measure next."""

from .suggest import Suggestion, suggest_stations

__all__ = ["Suggestion", "suggest_stations"]
