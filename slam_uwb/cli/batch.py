"""``slam-uwb batch``: many surveys at once."""

from __future__ import annotations

import json
import os
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import JsonOption, ModeOption, PairsOption, SettingsOption, VerboseOption
from .progress import rate_bar
from .solve import choose_settings
from .targets import TargetError, refuse_solution_target, replace_file

if TYPE_CHECKING:
    from ..batch.summary import SurveyRow
    from ..batch.surveys import SurveyTask

SUMMARY = "summary.csv"


_FoldersArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="DIR...",
        show_default=False,
        help="Survey folders, or folders that hold surveys at any depth.",
    ),
]
_OutOption = Annotated[
    Path,
    typer.Option(
        metavar="OUT",
        show_default=False,
        help="Folder to write: a solution folder a survey, and summary.csv. What an earlier "
        "batch solved there is taken where survey, settings and version are the same.",
    ),
]
_WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="N",
        show_default="as many as there are processors",
        help="Processes, each with one survey at a time.",
    ),
]
_SchedulerOption = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        show_default=False,
        help="Solve on the workers of this Dask scheduler (tcp://host:port) instead; they have "
        "this software and see the same files under the same paths.",
    ),
]


def batch(
    folders: _FoldersArgument,
    out: _OutOption,
    mode: ModeOption = None,
    pairs: PairsOption = None,
    settings: SettingsOption = None,
    workers: _WorkersOption = None,
    scheduler: _SchedulerOption = None,
    as_json: JsonOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Solve many surveys in parallel processes; goes on where an earlier batch was interrupted.

    A survey that cannot be solved has its row with the reason and stops nothing. Exit status 0 where
    every survey was solved, else 1.
    """
    chosen = choose_settings(settings, mode, pairs)

    from ..batch.surveys import find_surveys

    tasks = find_surveys(folders, out, chosen)
    _refuse_targets(tasks, out)
    rows = _solve(tasks, out, workers or _processors(), scheduler)
    _print(rows, out, as_json=as_json)
    if any(row.exit_status != 0 for row in rows):
        raise typer.Exit(1)


def _refuse_targets(tasks: list[SurveyTask], out: Path) -> None:
    """Everything that would destroy something, before any work is done."""
    for mark, kind in (("survey.toml", "survey"), ("solution.json", "solution")):
        if (out / mark).exists():
            raise TargetError(out, f"is a {kind} folder, not one of a batch")
    for task in tasks:
        refuse_solution_target(task.out, task.survey)


def _solve(
    tasks: list[SurveyTask], out: Path, workers: int, scheduler: str | None
) -> list[SurveyRow]:
    """The row of every survey; summary.csv is written where an interruption leaves some, too."""
    from ..batch.solving import solve_surveys
    from ..batch.summary import SurveyRow

    rows = [SurveyRow(task.name, None, reason="interrupted before it was solved") for task in tasks]
    try:
        with (
            rate_bar("surveys", len(tasks)) as advance,
            closing(solve_surveys(tasks, workers, scheduler)) as solved,
        ):
            for index, one in solved:
                rows[index] = one.row
                advance(f"{one.row.survey}{': there already' if one.resumed else ''}")
    except BaseException:
        if any(row.exit_status is not None for row in rows):
            _write(rows, out)
        raise
    _write(rows, out)
    return rows


def _write(rows: list[SurveyRow], out: Path) -> None:
    from ..batch.summary import summary_csv

    out.mkdir(parents=True, exist_ok=True)
    replace_file(out / SUMMARY, summary_csv(rows))


def _print(rows: list[SurveyRow], out: Path, *, as_json: bool) -> None:
    from ..batch.summary import format_rows

    if as_json:
        typer.echo(
            json.dumps({"surveys": [asdict(row) for row in rows], "out": str(out)}, indent=2)
        )
        return
    for line in format_rows(rows):
        typer.echo(line)
    typer.echo(f"summary   {out / SUMMARY}")


def _processors() -> int:
    """Those that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
