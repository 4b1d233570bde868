"""A comparison as CSV, Markdown and LaTeX."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence

from .comparison import MethodResult

COLUMNS = (
    "survey", "method", "mode", "initialiser", "refiner", "stations", "stations_ok", "station_rmse_m",
    "anchors", "anchors_ok", "anchor_rmse_m", "anchor_max_m", "anchor_nees_per_dof", "seconds", "failure",
)  # fmt: skip
HEADINGS = (
    "survey", "method", "stations ok", "station RMSE / m", "anchors ok", "anchor RMSE / m",
    "anchor max / m", "NEES / dof", "s",
)  # fmt: skip
_LEFT = 2
_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
}  # fmt: skip
_MARKDOWN = re.compile(r"([\\`*\[\]<>|])")
"""An underscore within a word means nothing in Markdown."""
_REASON_CHARACTERS = 90


def comparison_to_csv(results: Iterable[MethodResult]) -> str:
    """All columns, metres and seconds; what is not known is empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in results:
        writer.writerow([
            row.survey, row.method, row.mode, row.initialiser, row.refiner, row.stations,
            row.stations_ok, _fixed(row.station_rmse, 4), row.anchors, row.anchors_ok,
            _fixed(row.anchor_rmse, 4), _fixed(row.anchor_max, 4), _fixed(row.anchor_nees, 3),
            _fixed(row.seconds, 2), row.failure,
        ])  # fmt: skip
    return stream.getvalue()


def comparison_to_markdown(results: Iterable[MethodResult]) -> str:
    """A table for a README; a method that failed says why in place of its figures."""
    rule = ["---" if k < _LEFT else "---:" for k in range(len(HEADINGS))]
    rows = [HEADINGS, rule, *([_marked(cell) for cell in _cells(row)] for row in results)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def comparison_to_latex(results: Sequence[MethodResult]) -> str:
    """A `tabular` in the style of `booktabs`; a rule between surveys."""
    lines = [
        r"\begin{tabular}{" + "l" * _LEFT + "r" * (len(HEADINGS) - _LEFT) + "}",
        r"\toprule",
        _latex_row(HEADINGS),
        r"\midrule",
    ]
    for k, row in enumerate(results):
        if k and row.survey != results[k - 1].survey:
            lines.append(r"\midrule")
        if row.failure:
            name, method, reason = row.survey, row.method, _reason(row)
            span = len(HEADINGS) - _LEFT
            lines.append(
                f"{_latex(name)} & {_latex(method)} & "
                rf"\multicolumn{{{span}}}{{l}}{{{_latex(reason)}}} \\"
            )
        else:
            lines.append(_latex_row(_cells(row)))
    lines += [r"\bottomrule", r"\end{tabular}"]
    return "\n".join(lines) + "\n"


def _cells(row: MethodResult) -> list[str]:
    if row.failure:
        return [row.survey, row.method, _reason(row), *[""] * 5, _fixed(row.seconds, 1)]
    return [
        row.survey,
        row.method,
        f"{row.stations_ok} of {row.stations}",
        _fixed(row.station_rmse, 3) or "-",
        f"{row.anchors_ok} of {row.anchors}",
        _fixed(row.anchor_rmse, 3) or "-",
        _fixed(row.anchor_max, 3) or "-",
        _fixed(row.anchor_nees, 2) or "-",
        _fixed(row.seconds, 1),
    ]


def _reason(row: MethodResult) -> str:
    """The first line of what went wrong, cut where it is long; all of it is in the CSV."""
    first = row.failure.splitlines()[0]
    return first if len(first) <= _REASON_CHARACTERS else first[: _REASON_CHARACTERS - 3] + "..."


def _fixed(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if math.isfinite(value) else ""


def _marked(cell: str) -> str:
    return _MARKDOWN.sub(r"\\\1", cell)


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join(map(_latex, cells)) + r" \\"


def _latex(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
