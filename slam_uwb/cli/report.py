"""``slam-uwb report``: the report of a solution, drawn again from its folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import SolutionArgument, VerboseOption
from .solved_survey import read_solved_survey
from .targets import replace_file


def report(
    out: SolutionArgument,
    to: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default="report.html in OUT", help="Where to write the page."
        ),
    ] = None,
    _verbose: VerboseOption = False,
) -> None:
    """Draw the report of a solution again.

    One page that opens without a network. `solve` writes it already; this draws it again, with
    this version of the software, from what is in OUT. The survey's recordings are not needed.
    """
    from ..report.page import draw_report
    from ..report.pictures import REPORT

    target = out / REPORT if to is None else to
    replace_file(target, draw_report(read_solved_survey(out)).encode())
    typer.echo(f"report    {target}")
