"""One survey of a batch: solved, or found solved already, or why it cannot be."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from typing import Any

from .._version import __version__
from ..io import check_survey, survey_checksum, write_solution
from ..io.files import read_file
from ..io.folder_swap import remove_leftovers
from ..model.errors import SlamUwbError, SurveyFormatError
from ..pipeline import solve_survey
from .cluster import run_on_cluster
from .processes import run_tasks
from .summary import SurveyRow, solved_row
from .surveys import SurveyTask

STAMP = "batch.json"
"""In the solution folder: what was solved there, with what, and the row of the summary."""
SOLUTION_JSON = "solution.json"
MAX_STAMP_BYTES = 100_000
MAX_REASON = 500
"""Characters; a survey may have thousands of faults."""


@dataclass(frozen=True, slots=True)
class Solved:
    """What the work on one survey came to."""

    row: SurveyRow
    resumed: bool = False
    """Whether the solution was there already."""


def solve_surveys(
    tasks: Sequence[SurveyTask], workers: int, scheduler: str | None = None
) -> Generator[tuple[int, Solved], None, None]:
    """Place among the tasks and what it came to, as they come; closing the iterator ends the work.

    Args:
        tasks: surveys to solve.
        workers: processes of this machine.
        scheduler: address of a Dask scheduler whose workers are used instead.
    """
    outcomes = (
        run_tasks(solve_task, tasks, workers)
        if scheduler is None
        else run_on_cluster(solve_task, tasks, scheduler)
    )
    with closing(outcomes):
        for outcome in outcomes:
            if outcome.result is not None:
                yield outcome.index, outcome.result
            elif outcome.error is not None:
                task = tasks[outcome.index]
                yield outcome.index, Solved(failed_row(task, outcome.error))


def solve_task(task: SurveyTask) -> Solved:
    """Solve one survey into its folder, unless just that was done before; never raises for one survey.

    Doing it twice is doing it once: a batch that was interrupted, or a task that is given to a
    second worker because the first was lost, takes what is there.
    """
    try:
        _refuse_other_version(task)
        row = finished_row(task)
        if row is not None:
            return Solved(row, resumed=True)
        return Solved(_solve(task))
    except Exception as error:
        return Solved(failed_row(task, error))


def finished_row(task: SurveyTask) -> SurveyRow | None:
    """The row of a solution of this very survey, settings and version; None where there is none."""
    try:
        stamp = json.loads(read_file(task.out / STAMP, MAX_STAMP_BYTES).data)
        row = SurveyRow(**stamp.pop("row"))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    if not (task.out / SOLUTION_JSON).is_file() or stamp != _identity(task):
        return None
    return replace(row, survey=task.name)


def failed_row(task: SurveyTask, error: Exception) -> SurveyRow:
    """The row of a survey without a solution; the exit status is the one `solve` ends with."""
    status = 1
    reason = f"internal error, please report it: {type(error).__name__}: {error}"
    if isinstance(error, SlamUwbError):
        status, reason = error.exit_status, str(error)
    elif isinstance(error, OSError) and error.filename is not None:
        status, reason = 2, f"{error.filename}: {error.strerror}"
    if isinstance(error, SurveyFormatError) and len(error.faults) > 1:
        reason = f"{error.faults[0]} (and {len(error.faults) - 1} more: slam-uwb check)"
    if (task.out / SOLUTION_JSON).exists():
        reason += " (the solution in its folder is of an earlier state)"
    reason = " ".join(reason.split())
    shown = reason if len(reason) <= MAX_REASON else reason[: MAX_REASON - 3] + "..."
    return SurveyRow(task.name, status, software_version=__version__, reason=shown)


def _solve(task: SurveyTask) -> SurveyRow:
    from ..report.pictures import solution_pictures

    check = check_survey(task.survey)
    if check.survey is None:
        raise SurveyFormatError(check.faults)
    solution = solve_survey(check.survey, task.settings)
    row = solved_row(task.name, solution, len(check.warnings))
    stamp = _identity(task, solution.checksum) | {"row": asdict(row)}
    extras = solution_pictures(solution) | {STAMP: (json.dumps(stamp, indent=1) + "\n").encode()}
    write_solution(solution, task.out, extras=extras)
    # Of a process that was killed while it wrote this very folder.
    remove_leftovers(task.out)
    return row


def _identity(task: SurveyTask, checksum: str | None = None) -> dict[str, Any]:
    """What a solution depends on; ValueError where the survey cannot be read."""
    settings = json.dumps(task.settings.model_dump(mode="json"), sort_keys=True)
    return {
        "survey_checksum": survey_checksum(task.survey) if checksum is None else checksum,
        "settings_sha256": hashlib.sha256(settings.encode()).hexdigest(),
        "software_version": __version__,
    }


def _refuse_other_version(task: SurveyTask) -> None:
    if task.software_version != __version__:
        raise SlamUwbError(
            f"the worker has slam-uwb {__version__}, the batch is of {task.software_version}"
        )
