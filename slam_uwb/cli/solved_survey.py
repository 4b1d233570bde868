"""A solution to work on: the folder that `solve` wrote."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .targets import SOLUTION_FILE

if TYPE_CHECKING:
    from ..model.solution import Solution

_SURVEY_FILE = "survey.toml"


def read_solved_survey(out: Path) -> Solution:
    """The solution in a folder; SlamUwbError names the folder and says what writes one."""
    from ..io import read_solution
    from ..model.errors import SlamUwbError, SurveyFormatError

    if (out / _SURVEY_FILE).is_file() and not (out / SOLUTION_FILE).exists():
        raise SlamUwbError(
            f"{out}: is a survey that is not solved here: `slam-uwb solve {out} --out OUT` writes "
            "its solution, and OUT is the folder to give"
        )
    if not (out / SOLUTION_FILE).exists():
        what = f"no {SOLUTION_FILE} in it" if out.is_dir() else "no such folder"
        raise SlamUwbError(
            f"{out}: {what}: a solution is written by `slam-uwb solve SURVEY --out {out}`"
        )
    try:
        return read_solution(out)
    except SurveyFormatError as error:
        raise SlamUwbError(
            "\n".join(f"{out}: {line}" for line in str(error).splitlines())
        ) from None
