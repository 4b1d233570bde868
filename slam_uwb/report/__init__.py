"""Figures for people; the only home of matplotlib, so import it where it is used."""

from .figures import draw_solution, figure_png

__all__ = ["draw_solution", "figure_png"]
