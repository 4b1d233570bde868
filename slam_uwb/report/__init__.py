"""Figures and the report for people; the only home of matplotlib, so import it where it is used."""

from .comparison_figure import draw_comparison
from .curves import Curve, draw_curves
from .figures import draw_solution, figure_png
from .matching_figure import draw_match_steps
from .page import draw_report
from .positioning_figures import draw_distributions, draw_static_tags, draw_walk

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
