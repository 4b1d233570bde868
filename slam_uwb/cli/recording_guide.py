"""What the operator is asked while recording. An end of input ends the session."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import typer

from ..model.errors import CaptureError, SlamUwbError
from .recording_screen import say

_MAX_UNCONFIRMED_M = 6.0
"""A ceiling is rarely higher; an anchor there may be given in feet."""

_UPPER_M = 2.5
"""Of the paper's raised scans."""


def ask_station(survey: Path) -> str | None:
    """The identifier of the station to record next; None to end."""
    from ..io import check_station_name, recorded_stations

    known = recorded_stations(survey)
    broken = [name for name, item in known.items() if not item.complete]
    if broken:
        say(f"broke off, can be recorded again: {', '.join(broken)}")
    suggested = broken[0] if broken else _next_name(list(known))
    while True:
        answer = _ask(
            f"Set up the tripod. Enter records {suggested} (or type another name; q ends)"
        )
        if answer is None or answer.lower() == "q":
            return None
        station = answer or suggested
        try:
            check_station_name(station)
        except SlamUwbError as error:
            typer.echo(str(error))
            continue
        if station not in known or not known[station].complete:
            return station
        again = _ask(f"{station} is recorded already: record it again? (y/n) [n]")
        if again is None or again.lower() in ("y", "yes"):
            return station if again else None


def _next_name(known: Sequence[str]) -> str:
    number = len(known) + 1
    while f"s{number:02d}" in known:
        number += 1
    return f"s{number:02d}"


def ask_heights(survey: Path, radios: Sequence[str], foreign: set[str]) -> None:
    """The heights of anchors that the survey does not list; asked once for each.

    Args:
        survey: its folder.
        radios: heard just now.
        foreign: those that the operator called not ours; more are added.
    """
    from ..io import check_height, known_radios, put_anchor

    known = known_radios(survey)
    asked = [radio for radio in radios if radio not in known and radio not in foreign]
    if asked:
        say(
            "New anchors were heard. How high are their antennas above the floor, in metres? "
            "(Enter: not measured yet; -: not one of ours)"
        )
    for radio in asked:
        height = ask_number(f"  height of anchor {radio}", check_height, may_be_empty=True)
        if height is None:
            foreign.add(radio)
        else:
            put_anchor(survey, radio, None if math.isnan(height) else height)


def ask_upper_height(station: str) -> float | None:
    """The height in m to which the scanner is raised at a station; None to leave the raised scan out."""
    from ..io import check_height

    return ask_number(
        f"Raise the scanner of {station} without moving the tripod. Its height in m "
        f"(Enter: {_UPPER_M:g}; -: no raised scan)",
        check_height,
        may_be_empty=True,
        default=_UPPER_M,
    )


def ask_number(
    question: str,
    check: Callable[[float], None],
    *,
    may_be_empty: bool = False,
    default: float = math.nan,
) -> float | None:
    """A number that `check` (raises SlamUwbError) lets pass; `default` for an empty answer, None for `-` or none.

    Raises:
        typer.Abort: the input ended where an answer is needed.
    """
    while True:
        answer = _ask(question)
        if answer is None and not may_be_empty:
            raise typer.Abort
        if answer is None or (answer == "-" and may_be_empty):
            return None
        if not answer and may_be_empty:
            return default
        try:
            value = float(answer.replace(",", "."))
            check(value)
        except ValueError:
            say(f"{answer!r} is no number: expected a height in metres, e.g. 2.45")
            continue
        except SlamUwbError as error:
            say(f"{error}: expected e.g. 2.45")
            continue
        if value <= _MAX_UNCONFIRMED_M or (_ask(f"{value:g} m, sure? (y/n)") or "").lower() in (
            "y",
            "yes",
        ):
            return value


def ask_reconnect(error: CaptureError) -> bool:
    """Whether to try again after an instrument failed."""
    typer.echo(f"{error}", err=True)
    answer = _ask("Look at the instrument and its cable. Enter connects again, q ends")
    return answer is not None and answer.lower() != "q"


def _ask(question: str) -> str | None:
    """A line without blanks around it; None where the input ended."""
    from ..capture.signals import signals_let_in

    try:
        with signals_let_in():
            return input(f"{question}: ").strip()
    except EOFError:
        typer.echo()
        return None
