"""Folders -> the surveys in them, each with the folder that its solution goes to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from .._version import __version__
from ..model.errors import SlamUwbError
from ..model.settings import Settings

SURVEY_TOML = "survey.toml"


@dataclass(frozen=True, slots=True)
class SurveyTask:
    """One survey to solve; travels between processes and machines."""

    name: str
    """Where its solution goes, relative to the batch's folder, with ``/``."""
    survey: Path
    """Absolute."""
    out: Path
    """Absolute."""
    settings: Settings
    software_version: str = __version__
    """Of who asks: a worker with another one says so instead of answering."""


def find_surveys(folders: Sequence[Path], out: Path, settings: Settings) -> list[SurveyTask]:
    """A task a survey found, by name.

    Args:
        folders: surveys, or folders that hold surveys at any depth. Hidden folders and `out` are not
            looked into, nor is a survey for further ones.
        out: folder of the batch. A survey given by itself is solved into the folder of its name there,
            others into that of their path below the folder given.
        settings: of all of them.

    Raises:
        SlamUwbError: a folder holds no survey, or two surveys would share a solution folder.
    """
    found: dict[str, Path] = {}
    for folder in folders:
        inside = list(_surveys_below(folder, out.resolve()))
        if not inside:
            raise SlamUwbError(f"{folder}: no survey (no {SURVEY_TOML} in it or below)")
        for survey in inside:
            below = survey.relative_to(folder)
            name = (below if below.parts else Path(survey.resolve().name)).as_posix()
            if found.setdefault(name, survey.resolve()) != survey.resolve():
                raise _clash(found[name], survey, name)
    _refuse_nested(found)
    return [
        SurveyTask(name, survey, out.resolve() / name, settings)
        for name, survey in sorted(found.items())
    ]


def _surveys_below(folder: Path, out: Path) -> Iterator[Path]:
    if (folder / SURVEY_TOML).exists():
        yield folder
        return
    for child in sorted(folder.iterdir()) if folder.is_dir() else ():
        if child.name.startswith(".") or not child.is_dir() or child.resolve() == out:
            continue
        # A link to a survey is one; a link to a folder may lead in circles.
        if not child.is_symlink() or (child / SURVEY_TOML).exists():
            yield from _surveys_below(child, out)


def _refuse_nested(found: dict[str, Path]) -> None:
    for name, survey in found.items():
        for above in Path(name).parents:
            if above.as_posix() in found:
                raise _clash(found[above.as_posix()], survey, name)


def _clash(first: Path, second: Path, name: str) -> SlamUwbError:
    return SlamUwbError(
        f"{first} and {second} would both be solved into the folder {name}: "
        "name a folder above them, or one at a time"
    )
