"""Options that several commands share."""

from __future__ import annotations

import logging
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .._version import __version__


class Mode(StrEnum):
    """How poses and anchors are solved."""

    JOINT = "joint"
    SEQUENTIAL = "sequential"


class Pairs(StrEnum):
    """Which pairs of scans are matched."""

    ALL = "all"
    SEQUENCE = "sequence"


def show_version(wanted: bool) -> None:
    """Print the version and leave."""
    if wanted:
        typer.echo(f"slam-uwb {__version__}")
        raise typer.Exit


def log_verbosely(wanted: bool) -> None:
    """Let the package's own log records through to stderr."""
    if not wanted:
        return
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms %(name)s: %(message)s"))
    log = logging.getLogger("slam_uwb")
    # The option is accepted before and after the command's name.
    log.handlers[:] = [handler]
    log.setLevel(logging.DEBUG)


VerboseOption = Annotated[
    bool,
    typer.Option(
        "-v", "--verbose", callback=log_verbosely, help="Log what is being done to stderr."
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print JSON for programs instead of text.")
]
SurveyArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SURVEY", show_default=False, help="Survey folder: survey.toml, scans, ranges."
    ),
]
SolutionArgument = Annotated[
    Path,
    typer.Argument(metavar="OUT", show_default=False, help="Solution folder that `solve` wrote."),
]
NewSurveyOption = Annotated[
    Path,
    typer.Option(
        metavar="SURVEY",
        show_default=False,
        help="Survey folder to write: a new one, since nothing recorded is ever overwritten.",
    ),
]
ModeOption = Annotated[
    Mode | None,
    typer.Option(
        show_default="joint, or what --settings says",
        help="joint: poses and anchors in one problem. sequential: poses first, then each anchor "
        "(the paper).",
    ),
]
PairsOption = Annotated[
    Pairs | None,
    typer.Option(
        show_default="all, or what --settings says",
        help="all: match every promising pair of scans. sequence: only the pairs that survey.toml "
        "lists.",
    ),
]
SettingsOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|paper",
        show_default=False,
        help="TOML file with the settings that differ from the defaults (`slam-uwb settings` prints "
        "all of them), or `paper` for the paper's own numbers and matching.",
    ),
]
WorkersOption = Annotated[
    int,
    typer.Option(
        min=1,
        metavar="N",
        help="Processes that share the work of one survey; the result is the same.",
    ),
]
