"""Options that several commands share."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer

from .._version import __version__


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
