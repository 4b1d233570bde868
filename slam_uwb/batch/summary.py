"""What became of the surveys of a batch: a row each, and summary.csv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

from ..io.csv_text import table
from ..model.solution import Solution


@dataclass(frozen=True, slots=True)
class SurveyRow:
    """One survey. Times are left out: the same surveys give the same table."""

    survey: str
    exit_status: int | None
    """As `solve` ends; None where an interruption came first."""
    stations_ok: int | None = None
    stations: int | None = None
    anchors_ok: int | None = None
    anchors: int | None = None
    frame: str = ""
    warnings: int | None = None
    """Of the survey and of the solution."""
    checksum: str = ""
    """Of the survey's files."""
    software_version: str = ""
    reason: str = ""
    """Why it has no solution; one line."""


def solved_row(name: str, solution: Solution, warnings: int) -> SurveyRow:
    """The row of a survey that was solved."""
    return SurveyRow(
        survey=name,
        exit_status=0,
        stations_ok=sum(s.status == "ok" for s in solution.stations),
        stations=len(solution.stations),
        anchors_ok=sum(a.status == "ok" for a in solution.anchors),
        anchors=len(solution.anchors),
        frame=solution.frame,
        warnings=warnings + len(solution.warnings),
        checksum=solution.checksum,
        software_version=solution.software_version,
    )


def summary_csv(rows: Sequence[SurveyRow]) -> bytes:
    """All rows as CSV; empty where there is nothing to say."""
    header = [field.name for field in fields(SurveyRow)]
    return table(header, [["" if c is None else c for c in astuple(row)] for row in rows])


def format_rows(rows: Sequence[SurveyRow]) -> list[str]:
    """The table for a person: a line a survey, and the sum."""
    width = max((len(row.survey) for row in rows), default=0)
    lines = [_line(row, width) for row in rows]
    solved = sum(row.exit_status == 0 for row in rows)
    return [*lines, f"{solved} of {len(rows)} solved"]


def _line(row: SurveyRow, width: int) -> str:
    if row.exit_status == 0:
        said = (
            f"stations {row.stations_ok} of {row.stations} ok, "
            f"anchors {row.anchors_ok} of {row.anchors} ok"
        )
    else:
        ended = "not done" if row.exit_status is None else f"exit status {row.exit_status}"
        said = f"{ended}: {row.reason}"
    return f"{row.survey:<{width}}  {said}"
