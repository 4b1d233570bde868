"""Cells, rows and tables of the report: text with what it sorts by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..model.solution import Status

_MOST_ROWS = 3000
"""Of one table: a page of a building with hundreds of stations must still open on a phone."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell; a number sorts by its value, whatever its text."""

    text: str
    value: float | None = None
    mark: str = ""
    """CSS class."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row; `key` ties it to its mark on the map."""

    key: str
    cells: tuple[Cell, ...]
    quiet: bool = False
    """What is hidden until all rows are asked for."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table with a line that explains its columns."""

    name: str
    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    left_out: int = 0
    """Rows beyond the limit; the CSV files of the solution have them."""
    more: str = ""
    """What the quiet rows are called; empty where there are none."""


def metres(value: float | None, decimals: int = 2, sign: str = "") -> Cell:
    """A length, empty where it is not known."""
    if value is None or not math.isfinite(value):
        return Cell("")
    # Adding zero turns the -0.0 that rounding makes of small negative numbers into 0.0.
    return Cell(f"{round(float(value), decimals) + 0.0:{sign}.{decimals}f}", float(value))


def share(value: float) -> Cell:
    """A share 0-1 in per cent."""
    return Cell(f"{100.0 * value:.0f} %", value) if math.isfinite(value) else Cell("")


def count(number: int) -> Cell:
    """A number of things."""
    return Cell(str(number), float(number))


def status_cell(status: Status) -> Cell:
    """A status, marked where it is not ok."""
    return Cell(status.value, mark="fine" if status is Status.OK else "bad")


def build_table(
    name: str, title: str, note: str, columns: str, rows: Sequence[Row], more: str = ""
) -> Table:
    """A table with the titles of `columns` (joined by |); a column without any text is left out."""
    shown = rows[:_MOST_ROWS]
    # A column that says nothing costs a phone a third of its width.
    filled = [k for k, _ in enumerate(columns.split("|")) if any(r.cells[k].text for r in shown)]
    titles = columns.split("|")
    return Table(
        name,
        title,
        note,
        tuple(titles[k] for k in filled),
        tuple(replace(row, cells=tuple(row.cells[k] for k in filled)) for row in shown),
        len(rows) - len(shown),
        more,
    )
