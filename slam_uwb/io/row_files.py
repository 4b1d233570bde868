"""CSV files that grow row by row, are continued after a crash, and lose the rows of a station recorded again."""

from __future__ import annotations

import csv
import gzip
import io
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TextIO

from ..model.errors import Fault, SurveyFormatError
from .tables import MAX_LINE_CHARACTERS

Row = dict[str, str]
_HELD_CHARACTERS = 1_000_000
"""Of removed rows, before they are written."""


def append_durably(path: Path, data: bytes) -> None:
    """Add to the file and see it on the disk."""
    with path.open("ab") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())


def rewrite_rows(
    path: Path, header: Sequence[str], keep: Callable[[Row], bool], removed: Path
) -> None:
    """Make the table at `path` (or path.gz) one of plain text with just these columns, or leave it as it was.

    Works in constant memory. A last line that a crash tore is left out.

    Args:
        path: need not exist.
        header: the columns from now on.
        keep: says of each row whether it stays.
        removed: where the rows that go are appended, so that nothing recorded is lost.

    Raises:
        SurveyFormatError: the file is no such table.
    """
    packed = path.with_name(f"{path.name}.gz")
    source = next((p for p in (path, packed) if p.exists()), None)
    if source is None:
        return
    fresh = path.with_name(f".{path.name}.partial")
    try:
        with fresh.open("w", newline="") as file:
            kept = _writer(file, header)
            kept.writeheader()
            with _appending(removed, header) as put_aside:
                for row in _rows(source, header):
                    (kept.writerow if keep(row) else put_aside)(row)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
        packed.unlink(missing_ok=True)
    finally:
        fresh.unlink(missing_ok=True)


@contextmanager
def _appending(path: Path, header: Sequence[str]) -> Iterator[Callable[[Row], None]]:
    """Takes rows to add to a table, which is made with the first of them; durable when this is left."""
    text = io.StringIO()
    writer = _writer(text, header)

    def write_out() -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        start = "" if path.exists() else ",".join(header) + "\n"
        append_durably(path, (start + text.getvalue()).encode())
        text.seek(0)
        text.truncate()

    def add(row: Row) -> None:
        writer.writerow(row)
        if text.tell() > _HELD_CHARACTERS:
            write_out()

    yield add
    if text.tell():
        write_out()


def _writer(file: TextIO, header: Sequence[str]) -> csv.DictWriter[str]:
    return csv.DictWriter(file, header, extrasaction="ignore", lineterminator="\n")


def _rows(source: Path, header: Sequence[str]) -> Iterator[Row]:
    """Rows of a table; those of a torn last line left out."""
    with _opened(source) as stream:
        lines = _whole_lines(stream, source.name)
        first = next(lines, "")
        names = [name.strip() for name in next(csv.reader([first]), [])]
        required = list(header)[:3]
        if not set(required) <= set(names):
            raise SurveyFormatError(
                [Fault(source.name, f"the header is {first!r}, expected {','.join(required)}", 1)]
            )
        for line in lines:
            cells = next(csv.reader([line]), [])
            if len(cells) == len(names):
                yield dict(zip(names, (cell.strip() for cell in cells), strict=True))


def _opened(source: Path) -> gzip.GzipFile | IO[bytes]:
    return gzip.open(source, "rb") if source.suffix == ".gz" else source.open("rb")


def _whole_lines(stream: gzip.GzipFile | IO[bytes], name: str) -> Iterator[str]:
    number = 0
    while line := stream.readline(MAX_LINE_CHARACTERS + 1):
        number += 1
        if len(line) > MAX_LINE_CHARACTERS:
            raise SurveyFormatError(
                [Fault(name, f"a line of more than {MAX_LINE_CHARACTERS:,} bytes", number)]
            )
        if line.endswith(b"\n"):
            yield line.decode("utf-8-sig" if number == 1 else "utf-8", "replace").rstrip("\r\n")
