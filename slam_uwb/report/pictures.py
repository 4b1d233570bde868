"""The files for people that a solution folder holds beside those for programs."""

from __future__ import annotations

from collections.abc import Callable

from ..model.products import Share, alone
from ..model.solution import Solution

FIGURE, REPORT = "figure.png", "report.html"
"""Their names in the folder."""


def solution_pictures(solution: Solution, share: Share = alone) -> dict[str, bytes]:
    """Figure and report by their names; the same solution gives the same bytes."""
    names = REPORT, FIGURE
    made = share(_picture, [(_PICTURES[name], solution) for name in names])
    return dict(zip(names, made, strict=True))


def _picture(what: tuple[Callable[[Solution], bytes], Solution]) -> bytes:
    draw, solution = what
    return draw(solution)


def _figure(solution: Solution) -> bytes:
    # Each imports its own library: the process that draws the one need not load the other's.
    from .figures import draw_solution, figure_png

    return figure_png(draw_solution(solution))


def _report(solution: Solution) -> bytes:
    from .page import draw_report

    return draw_report(solution).encode()


_PICTURES = {FIGURE: _figure, REPORT: _report}
