"""The files for people that a solution folder holds beside those for programs."""

from __future__ import annotations

from ..model.solution import Solution
from .figures import draw_solution, figure_png
from .page import REPORT, draw_report

FIGURE = "figure.png"


def solution_pictures(solution: Solution) -> dict[str, bytes]:
    """Figure and report by their names in the folder; the same solution gives the same bytes."""
    return {
        FIGURE: figure_png(draw_solution(solution)),
        REPORT: draw_report(solution).encode(),
    }
