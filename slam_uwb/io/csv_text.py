"""Numbers and rows -> CSV text: fixed decimals, empty where unknown, the same bytes every time."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence

import numpy as np

from ..model.geometry import FloatArray

Cell = str | int | bool


def number(value: float | None, decimals: int | None) -> str:
    """A number with fixed decimals, or all digits it takes (None); empty where it is not known."""
    if value is None or not math.isfinite(value):
        return ""
    if decimals is None:
        return repr(float(value))
    # Adding zero turns the -0.0 that rounding makes of small negative numbers into 0.0.
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"


def numbers(values: FloatArray, decimals: int | None) -> list[str]:
    """(N,) as `number` does, for recordings of many thousand rows."""
    if decimals is None or not len(values):
        return [number(value, decimals) for value in values.tolist()]
    pattern = f"%.{decimals}f"
    rounded = np.round(values, decimals) + 0.0
    return [
        pattern % value if known else ""
        for value, known in zip(rounded.tolist(), np.isfinite(values).tolist(), strict=True)
    ]


def table(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> bytes:
    """UTF-8 CSV with a header line; true and false as in TOML."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(cell) for cell in row] for row in rows)
    return stream.getvalue().encode()


def columns(header: Sequence[str], *cells: Sequence[str]) -> bytes:
    """As `table`, column by column, for cells that need no quotes (numbers and identifiers)."""
    lines = [",".join(header), *map(",".join, zip(*cells, strict=True))]
    return ("\n".join(lines) + "\n").encode()


def _cell(cell: Cell) -> Cell:
    return str(cell).lower() if isinstance(cell, bool) else cell
