"""CSV tables of numbers and identifiers, with file, line, column and value of everything that is wrong.

numpy's C parser reads what is sound; only what it refuses is read again cell by cell, to say what and where.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .files import FileContent
from .findings import Findings, shown

MAX_LINE_CHARACTERS = 10_000
"""A line of any of our tables has some dozens; a longer one is another kind of file."""

_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE
)
"""What numpy's parser takes, spelt out: Python's float() would also take 1_000 and other scripts' digits."""


@dataclass(frozen=True, slots=True)
class Column:
    """What a column of a table holds."""

    name: str
    number: bool = True
    """False for identifiers and other text."""
    required: bool = True
    """The header must have it."""
    may_be_empty: bool = False
    """An empty cell is NaN."""
    finite: bool = False
    """`nan` and `inf` are faults."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The rows of one file, by column; columns that the file does not have are missing."""

    name: str
    lines: NDArray[np.int64]
    """(R,) line number of each row in the file."""
    numbers: dict[str, FloatArray]
    """(R,) each; NaN where a cell is empty or wrong."""
    texts: dict[str, tuple[str, ...]]
    """R each, stripped."""
    sound: bool
    """False where a fault was found: do not judge the values any further."""


def read_table(content: FileContent, columns: Sequence[Column], findings: Findings) -> Table | None:
    """Read a CSV file; None where its header cannot be used. Faults and warnings go to `findings`."""
    text = _decoded(content, findings)
    if text is None or not _lines_are_bounded(text, content.name, findings):
        return None
    header, _, body = text.partition("\n")
    names = _header(header, columns, content.name, findings)
    if names is None:
        return None
    wanted = [column for column in columns if column.name in names]
    fast = (
        _read_numbers(body, names, wanted, content.name) if all(c.number for c in wanted) else None
    )
    return fast or _read_cells(body, names, wanted, content.name, findings)


def _decoded(content: FileContent, findings: Findings) -> str | None:
    data = content.data.removeprefix(b"\xef\xbb\xbf")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        findings.fault(content.name, f"byte 0x{data[error.start]:02X}: expected UTF-8 text", line)
        return None
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _lines_are_bounded(text: str, name: str, findings: Findings) -> bool:
    lengths = [len(line) for line in text.split("\n")]
    if max(lengths) <= MAX_LINE_CHARACTERS:
        return True
    line = next(i for i, length in enumerate(lengths, 1) if length > MAX_LINE_CHARACTERS)
    findings.fault(
        name, f"a line of more than {MAX_LINE_CHARACTERS:,} characters: expected a CSV file", line
    )
    return False


def _header(
    line: str, columns: Sequence[Column], name: str, findings: Findings
) -> list[str] | None:
    """Names of the file's columns in its order; None where one is missing or there twice."""
    cells = _split(line)
    names = [cell.strip() for cell in cells] if cells is not None else [line]
    known = {column.name for column in columns}
    required = [column.name for column in columns if column.required]
    missing = [column for column in required if column not in names]
    for column in missing:
        hint = "; columns are separated by commas" if ";" in line or "\t" in line else ""
        findings.fault(
            name,
            f"missing: the header is {shown(line)}, expected {','.join(required)}{hint}",
            1,
            column,
        )
    repeated = sorted({column for column in names if column in known and names.count(column) > 1})
    for column in repeated:
        findings.fault(name, f"is there {names.count(column)} times: expected once", 1, column)
    if missing or repeated:
        return None
    for column in names:
        if column not in known:
            findings.warn(name, f"unknown column {shown(column)} is ignored", 1)
    return names


def _read_numbers(body: str, names: list[str], wanted: list[Column], name: str) -> Table | None:
    """The rows by numpy's C parser; None where anything is not plainly as it should be."""
    rows = _row_lines(body, len(names))
    if rows is None or not len(rows):
        return None
    places = [names.index(column.name) for column in wanted]
    try:
        values = np.loadtxt(
            io.StringIO(_filled(body)), delimiter=",", comments=None, usecols=places, ndmin=2
        )
    except ValueError:
        return None
    strict = [i for i, column in enumerate(wanted) if column.finite or not column.may_be_empty]
    if len(values) != len(rows) or not np.isfinite(values[:, strict]).all():
        return None
    numbers = {column.name: values[:, i].copy() for i, column in enumerate(wanted)}
    return Table(name, rows, numbers, {}, sound=True)


def _row_lines(body: str, width: int) -> NDArray[np.int64] | None:
    """(R,) line numbers of the rows that are not blank; None where one has not `width` fields."""
    codes = np.frombuffer(body.encode() + b"\n", dtype=np.uint8)
    ends = np.flatnonzero(codes == ord("\n"))
    starts = np.concatenate([[0], ends[:-1] + 1])
    rows = np.flatnonzero(ends > starts)
    commas = np.diff(np.searchsorted(np.flatnonzero(codes == ord(",")), ends), prepend=0)
    return rows + 2 if (commas[rows] == width - 1).all() else None


def _filled(body: str) -> str:
    """The text with `nan` in every empty cell: numpy's parser refuses empty ones."""
    # Twice, since neighbouring empty cells share a comma.
    text = f"\n{body}\n".replace(",,", ",nan,").replace(",,", ",nan,")
    return text.replace(",\n", ",nan\n").replace("\n,", "\nnan,")


def _read_cells(
    body: str, names: list[str], wanted: list[Column], name: str, findings: Findings
) -> Table:
    """The rows cell by cell, noting every cell that is wrong."""
    lines: list[int] = []
    rows: list[list[str]] = []
    sound = True
    for line, text in enumerate(body.split("\n"), 2):
        if not text.strip():
            continue
        cells = _split(text)
        if cells is None or len(cells) != len(names):
            found = "an open quote" if cells is None else f"{len(cells)} fields"
            findings.fault(name, f"{found} in {shown(text)}: expected {len(names)} fields", line)
            sound = False
            continue
        lines.append(line)
        rows.append(cells)
    by_name = (
        dict(zip(names, zip(*rows, strict=True), strict=True)) if rows else dict.fromkeys(names, ())
    )
    numbers: dict[str, FloatArray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    for column in wanted:
        if not column.number:
            texts[column.name] = tuple(map(str.strip, by_name[column.name]))
            continue
        numbers[column.name], good = _column(by_name[column.name], lines, column, name, findings)
        sound = sound and good
    return Table(name, np.array(lines, dtype=np.int64), numbers, texts, sound)


def _column(
    cells: Sequence[str], lines: list[int], column: Column, name: str, findings: Findings
) -> tuple[FloatArray, bool]:
    """(R,) numbers of a column, and whether each is as it should be."""
    fast = _plain_column(cells, column)
    if fast is not None:
        return fast, True
    values = np.full(len(cells), np.nan)
    good = True
    for row, cell in enumerate(map(str.strip, cells)):
        problem = None
        if not cell:
            problem = None if column.may_be_empty else "empty: expected a number"
        elif _NUMBER.fullmatch(cell) is None:
            problem = f"{shown(cell)}: expected a number"
        else:
            values[row] = float(cell)
            if column.finite and not np.isfinite(values[row]):
                problem = f"{shown(cell)}: expected a finite number"
        if problem is not None:
            findings.fault(name, problem, lines[row], column.name)
            good = False
    return values, good


def _plain_column(cells: Sequence[str], column: Column) -> FloatArray | None:
    """(R,) by numpy's C parser; None where a cell needs a closer look."""
    if not cells or (not column.may_be_empty and not all(cells)):
        return None
    text = "\n".join(cell or "nan" for cell in cells)
    try:
        values = np.loadtxt(io.StringIO(text), delimiter=",", comments=None, ndmin=1)
    except ValueError:
        return None
    if values.shape != (len(cells),) or (column.finite and not np.isfinite(values).all()):
        return None
    return values


def _split(line: str) -> list[str] | None:
    """Fields of one line; None where a quote is left open."""
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error:
        return None
