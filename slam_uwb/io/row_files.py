"""CSV files that grow row by row, are continued after a crash, and lose the rows of a station recorded again."""

from __future__ import annotations

import csv
import gzip
import io
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO

from ..model.errors import Fault, SurveyFormatError
from .tables import MAX_LINE_CHARACTERS

Row = dict[str, str]


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
    gone = 0
    try:
        with fresh.open("w", newline="") as kept_file, io.StringIO() as removed_text:
            kept = csv.DictWriter(kept_file, header, extrasaction="ignore", lineterminator="\n")
            lost = csv.DictWriter(removed_text, header, extrasaction="ignore", lineterminator="\n")
            kept.writeheader()
            for row in _rows(source, header):
                if keep(row):
                    kept.writerow(row)
                    continue
                gone += 1
                lost.writerow(row)
                if removed_text.tell() > 1_000_000:
                    _put_aside(removed, header, removed_text)
            if gone:
                _put_aside(removed, header, removed_text)
            kept_file.flush()
            os.fsync(kept_file.fileno())
        fresh.replace(path)
        packed.unlink(missing_ok=True)
    finally:
        fresh.unlink(missing_ok=True)


def _put_aside(removed: Path, header: Sequence[str], text: io.StringIO) -> None:
    removed.parent.mkdir(parents=True, exist_ok=True)
    start = "" if removed.exists() else ",".join(header) + "\n"
    append_durably(removed, (start + text.getvalue()).encode())
    text.seek(0)
    text.truncate()


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
