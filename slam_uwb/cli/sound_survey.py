"""A survey to work on: without a fault, its warnings shown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .summary import print_warnings

if TYPE_CHECKING:
    from ..model.survey import Survey


def read_sound_survey(folder: Path) -> Survey:
    """The survey, its warnings shown; SurveyFormatError with every fault where it has any."""
    from ..io import check_survey
    from ..model.errors import SlamUwbError, SurveyFormatError

    if folder.is_dir() and not (folder / "survey.toml").exists():
        raise SlamUwbError(f"{folder}: no survey.toml in it: expected a survey folder")
    result = check_survey(folder)
    print_warnings(map(str, result.warnings))
    if result.survey is None or result.faults:
        raise SurveyFormatError(result.faults)
    return result.survey
