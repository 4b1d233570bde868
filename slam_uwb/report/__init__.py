"""Figures and the report for people; the only home of matplotlib.

The public names are loaded when they are first used: the report's page is drawn without matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .comparison_figure import draw_comparison
    from .curves import Curve, draw_curves
    from .figures import draw_solution, figure_png
    from .matching_figure import draw_match_steps
    from .page import draw_report
    from .positioning_figures import draw_distributions, draw_static_tags, draw_walk

_HOMES = {
    "Curve": "curves",
    "draw_comparison": "comparison_figure",
    "draw_curves": "curves",
    "draw_distributions": "positioning_figures",
    "draw_match_steps": "matching_figure",
    "draw_report": "page",
    "draw_solution": "figures",
    "draw_static_tags": "positioning_figures",
    "draw_walk": "positioning_figures",
    "figure_png": "figures",
}

__all__ = [
    "Curve",
    "draw_comparison",
    "draw_curves",
    "draw_distributions",
    "draw_match_steps",
    "draw_report",
    "draw_solution",
    "draw_static_tags",
    "draw_walk",
    "figure_png",
]


def __getattr__(name: str) -> object:
    """Import a public name from its home on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
