"""``slam-uwb plan``: where to measure next."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from .options import JsonOption, SolutionArgument, VerboseOption
from .solved_survey import read_solved_survey


def plan(
    out: SolutionArgument,
    count: Annotated[
        int, typer.Option(min=1, max=10, metavar="N", help="How many places to suggest.")
    ] = 3,
    as_json: JsonOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Suggest where to put the tripod next.

    Where it lowers the anchors' uncertainty most. Only places in the known free space are
    suggested, from where enough known walls are in view for the scan to be matched. The survey's
    recordings are not needed.
    """
    from ..planning import suggest_stations

    solution = read_solved_survey(out)
    found = suggest_stations(solution, count, solution.settings.planning)
    if as_json:
        rows = [
            {
                "x_m": round(float(item.place[0]), 2),
                "y_m": round(float(item.place[1]), 2),
                "anchors_before_m": round(item.before, 4),
                "anchors_after_m": round(item.after, 4),
                "known_view": round(item.known_view, 3),
            }
            for item in found
        ]
        typer.echo(json.dumps(rows, indent=2))
        return
    if not found:
        typer.echo("no place to suggest: there is no map with room for a tripod, or no anchor")
    for rank, item in enumerate(found, 1):
        typer.echo(
            f"{rank}. x {item.place[0]:.2f} m, y {item.place[1]:.2f} m: anchors from "
            f"{item.before:.2f} m to {item.after:.2f} m, {100.0 * item.known_view:.0f} % of the view known"
        )
