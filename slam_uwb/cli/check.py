"""``slam-uwb check``: every fault and warning of a survey folder."""

from __future__ import annotations

import json
from collections.abc import Sized
from dataclasses import asdict

import typer

from .options import JsonOption, SurveyArgument, VerboseOption


def check(
    survey: SurveyArgument, as_json: JsonOption = False, _verbose: VerboseOption = False
) -> None:
    """Print every fault and warning of a survey folder, and where.

    Each is named with its file, line and column. A fault keeps the survey from being solved (exit
    status 2); a warning does not. A positioning recording (a folder with positioning.toml) is
    looked at in the same way.
    """
    from ..io import check_survey
    from ..io.positioning_toml import POSITIONING_TOML
    from ..io.tag_recording import check_tag_recording
    from ..model.errors import SurveyFormatError

    is_recording = (survey / POSITIONING_TOML).is_file()
    result = check_tag_recording(survey) if is_recording else check_survey(survey)
    if as_json:
        report = {"survey": str(survey), "ok": not result.faults}
        lists = {"faults": result.faults, "warnings": result.warnings}
        typer.echo(
            json.dumps(
                report | {name: [asdict(item) for item in found] for name, found in lists.items()},
                indent=2,
            )
        )
    else:
        for kind, found in (("fault", result.faults), ("warning", result.warnings)):
            for item in found:
                typer.echo(f"{kind}: {item}")
        typer.echo(
            f"{survey}: {_number(result.faults, 'fault')}, {_number(result.warnings, 'warning')}"
        )
    if result.faults:
        raise typer.Exit(SurveyFormatError.exit_status)


def _number(items: Sized, noun: str) -> str:
    return f"{len(items)} {noun}" if len(items) == 1 else f"{len(items) or 'no'} {noun}s"
