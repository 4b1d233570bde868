"""A file to import: bounded in size, its lines bounded in length, its faults told with line and field."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from ...model.errors import Fault, SlamUwbError, SurveyFormatError
from ..files import FileContent, read_file
from ..findings import Findings, shown
from ..survey_toml import IDENTIFIER
from ..tables import MAX_LINE_CHARACTERS

_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|inf|nan)", re.ASCII | re.IGNORECASE
)
_ENDING = re.compile(
    r"\.(?:gz|csv|txt|log|clf|bag|db3|mcap|pcd|ply|las|laz|e57)(?=\.|$)", re.IGNORECASE
)


def station_name(path: Path) -> str:
    """The identifier of the station that a file is of: its name up to the first known ending."""
    stem = _ENDING.split(path.name, maxsplit=1)[0]
    if re.match(IDENTIFIER, stem) is None or not stem[0].isalnum():
        raise SlamUwbError(
            f"{path.name}: the file's name is its station's: expected A-Z a-z 0-9 _ . -, a letter or digit first"
        )
    return stem


def read_source(path: Path) -> FileContent:
    """The file, unpacked; SurveyFormatError where it is too large, no file, or no whole gzip file."""
    try:
        return read_file(path)
    except (ValueError, OSError) as error:
        problem = getattr(error, "strerror", None) or str(error)
        raise SurveyFormatError([Fault(str(path), problem)]) from None


def lines(content: FileContent, limit: int = MAX_LINE_CHARACTERS) -> Iterator[tuple[int, str]]:
    """Numbered lines without their ends; SurveyFormatError at one that is too long or no text."""
    for number, raw in enumerate(content.data.split(b"\n"), 1):
        if len(raw) > limit:
            raise fault(content, number, None, f"a line of more than {limit:,} bytes")
        try:
            yield number, raw.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r")
        except UnicodeDecodeError:
            raise fault(content, number, None, f"{raw[:20]!r}: expected UTF-8 text") from None


def numbers(content: FileContent, line: int, fields: list[str], names: list[str]) -> list[float]:
    """The fields as numbers; SurveyFormatError that names the first that is none."""
    for name, text in zip(names, fields, strict=True):
        if _NUMBER.fullmatch(text) is None:
            raise fault(content, line, name, f"{shown(text)}: expected a number")
    return [float(text) for text in fields]


def fault(
    content: FileContent, line: int | None, field: str | None, problem: str
) -> SurveyFormatError:
    """The error for one place of a file."""
    return SurveyFormatError([Fault(content.name, problem, line, field)])


def raise_faults(findings: Findings) -> None:
    """SurveyFormatError where any fault was noted."""
    if findings.faults:
        raise SurveyFormatError(findings.faults)
