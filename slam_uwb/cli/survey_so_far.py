"""How a survey stands while it is recorded: map, what is placed and determined, where to go next."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .next_place import NextPlace, find_next_place
from .progress import Progress, progress_bar
from .recording_screen import say

if TYPE_CHECKING:
    from ..model.solution import AnchorEstimate, Solution

PATIENCE_S = 60.0
"""The operator waits no longer than that for a look at the survey."""
_COLUMNS, _ROWS, _FEWEST_ROWS = 76, 30, 10
_OTHER_ROWS = 12
"""Of the terminal, for what stands below the map: it should not push the map's top away."""
_LEGEND = "█ wall, · floor seen, o station, A anchor"


class _TooLongError(Exception):
    """The survey takes longer to solve than the operator waits."""


def show_survey_so_far(survey: Path, station: str) -> None:
    """Solve what there is and print how it stands; a survey that cannot be solved yet is no error."""
    from ..capture.signals import signals_let_in
    from ..io import read_survey, recorded_stations
    from ..model.errors import SlamUwbError
    from ..pipeline import solve_survey

    if sum(bool(item.files) for item in recorded_stations(survey).values()) < 2:
        say("one station so far: from the second one on you see how they fit together")
        return
    try:
        with signals_let_in(), progress_bar() as progress:
            solution = solve_survey(read_survey(survey), progress=_within(PATIENCE_S, progress))
            place = find_next_place(solution, station)
    except SlamUwbError as error:
        say(f"the survey so far: {error}")
    except _TooLongError:
        say(
            f"the survey so far: not solved within {PATIENCE_S:g} s; `slam-uwb solve {survey} --out OUT` "
            "does it, and --no-solve leaves it out here"
        )
    else:
        _print(solution, station, place)


def _within(
    limit: float, progress: Progress, now: Callable[[], float] = time.monotonic
) -> Progress:
    """`progress` that raises `_TooLongError` once `limit` s are over."""
    end = now() + limit

    def report(what: str, done: int, total: int) -> None:
        if now() > end:
            raise _TooLongError
        progress(what, done, total)

    return report


def _print(solution: Solution, station: str, place: NextPlace | None) -> None:
    from ..report.trust import MEANING
    from .text_map import draw_text_map

    where = None if place is None else place.place
    columns, rows = shutil.get_terminal_size((80, 40))
    size = min(columns - 2, _COLUMNS), min(max(rows - _OTHER_ROWS, _FEWEST_ROWS), _ROWS)
    drawn = draw_text_map(solution, *size, place=where)
    for line in drawn:
        typer.echo(line)
    if drawn:
        say(f"{_LEGEND}{', x go there next' if place is not None else ''}")
    placed = [s for s in solution.stations if s.status == "ok"]
    say(f"{_state(solution, station)}{len(placed)} of {len(solution.stations)} placed")
    others = [
        f"{s.id} ({s.status}: {MEANING[s.status]})" for s in solution.stations if s.status != "ok"
    ]
    if others:
        say(f"not placed: {', '.join(others)}")
    for anchor in solution.anchors:
        heard = sum(link.anchor == anchor.id for link in solution.links)
        say(f"  anchor {anchor.id}, heard at {heard}: {_anchor_state(anchor)}")
    if place is not None:
        say(f"next (x in the map): {place.words}")


def _state(solution: Solution, station: str) -> str:
    here = next((s for s in solution.stations if str(s.id) == station), None)
    if here is None:
        return ""
    return f"station {station} {'placed' if here.status == 'ok' else 'not placed'}; "


def _anchor_state(anchor: AnchorEstimate) -> str:
    from ..report.trust import MEANING

    if anchor.status != "ok" or anchor.covariance is None:
        return f"not determined yet, {MEANING[anchor.status]}"
    sigma = math.sqrt(max(float(anchor.covariance[0, 0] + anchor.covariance[1, 1]), 0.0))
    return f"determined within {sigma:.2f} m (1 sigma)"
