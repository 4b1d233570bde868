"""Tripod LiDAR scans and UWB ranges -> floor map, station poses and anchor coordinates, with uncertainty.

The public names are loaded when they are first used, so that importing the package costs next to
nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from ._version import __version__

if TYPE_CHECKING:
    from .evaluate import evaluate_solution
    from .io import (
        read_reference,
        read_settings,
        read_solution,
        read_survey,
        write_solution,
        write_survey,
    )
    from .model.geometry import Pose2
    from .model.settings import PRESETS, Settings
    from .model.solution import Solution
    from .model.survey import Reference, Survey
    from .pipeline import solve_survey
    from .processes import sharing
    from .simulate import simulate_survey

_HOMES = {
    "PRESETS": "model.settings",
    "Pose2": "model.geometry",
    "Reference": "model.survey",
    "Settings": "model.settings",
    "Solution": "model.solution",
    "Survey": "model.survey",
    "evaluate_solution": "evaluate",
    "read_reference": "io",
    "read_settings": "io",
    "read_solution": "io",
    "read_survey": "io",
    "sharing": "processes",
    "simulate_survey": "simulate",
    "solve_survey": "pipeline",
    "write_solution": "io",
    "write_survey": "io",
}

__all__ = [
    "PRESETS",
    "Pose2",
    "Reference",
    "Settings",
    "Solution",
    "Survey",
    "__version__",
    "evaluate_solution",
    "read_reference",
    "read_settings",
    "read_solution",
    "read_survey",
    "sharing",
    "simulate_survey",
    "solve_survey",
    "write_solution",
    "write_survey",
]


def __getattr__(name: str) -> object:
    """Import a public name from its home on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
