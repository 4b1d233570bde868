"""The recording of one station after the other, with instruments that stay connected between them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .interruption import Interrupted
from .recording_guide import ask_heights, ask_reconnect, ask_station, ask_upper_height
from .recording_screen import live_screen, print_station, say
from .survey_so_far import show_survey_so_far

if TYPE_CHECKING:
    from ..capture.clock import Clock
    from ..capture.ports.device import Device
    from ..capture.ports.session import Instrument
    from ..capture.recorder import Sink, StationReport


@dataclass(frozen=True, slots=True)
class Plan:
    """What the whole session goes by."""

    survey: Path
    devices: tuple[tuple[Device[Any], str], ...]
    """With the port as the operator named it."""
    seconds: float
    upper: bool
    """Whether the scanner is raised for a second scan at each station."""
    keep_raw: bool
    solve: bool
    clock: Clock


@dataclass(slots=True)
class _Open:
    """What outlasts a lost connection."""

    station: str | None = None
    """One that was recorded; its raised scan, or the look at the survey, is still to come."""
    foreign: set[str] = field(default_factory=set)
    """Radios that the operator called somebody else's."""


def run_sessions(plan: Plan) -> None:
    """Stations until the operator ends; instruments that failed are connected again.

    Raises:
        CaptureError: an instrument failed for good.
    """
    from ..model.errors import CaptureError

    left = _Open()
    while True:
        try:
            _run_session(plan, left)
        except CaptureError as error:
            if not ask_reconnect(error):
                raise
        else:
            _say_how_it_ended(plan)
            return


def _say_how_it_ended(plan: Plan) -> None:
    """How many stations there are, and the two commands that may come next."""
    from ..io import recorded_stations

    number = len(recorded_stations(plan.survey))
    if number:
        say(
            f"{number} station{'s' if number > 1 else ''} in {plan.survey}. The same command goes on; "
            f"`slam-uwb solve {plan.survey} --out OUT` solves the survey."
        )


def _run_session(plan: Plan, left: _Open) -> None:
    from ..capture.signals import signals_held

    # Signals outlast the instruments: a second one must not come between the first and the motor's stop.
    with signals_held(), ExitStack() as stack:
        instruments = [_connect(stack, device, port, plan) for device, port in plan.devices]
        _finish_station(plan, instruments, left)
        while (station := ask_station(plan.survey)) is not None:
            _record(plan, instruments, station, left.foreign)
            left.station = station
            _finish_station(plan, instruments, left)


def _connect(stack: ExitStack, device: Device[Any], wanted: str, plan: Plan) -> Instrument[Any]:
    from ..capture.ports import connected
    from ..capture.ports.find import find_port

    turning = " (its motor settles for some seconds)" if device.sample_hz is not None else ""
    say(f"connecting the {device.title} ...{turning}")
    port = find_port(device, wanted)
    instrument = stack.enter_context(connected(device, port, plan.clock))
    _print_identity(instrument)
    return instrument


def _finish_station(plan: Plan, instruments: Sequence[Instrument[Any]], left: _Open) -> None:
    """The raised scan of a station, and how the survey stands after it."""
    if left.station is None:
        return
    if plan.upper and (height_m := ask_upper_height(left.station)) is not None:
        _record_upper(plan, instruments, left.station, height_m)
    if plan.solve:
        show_survey_so_far(plan.survey, left.station)
    left.station = None


def _print_identity(instrument: Instrument[Any]) -> None:
    facts = dict(instrument.identity)
    warning = facts.pop("warning", None)
    told = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in facts.items())
    say(f"{instrument.name}: {told}")
    if warning:
        typer.echo(f"warning: {warning}", err=True)


def _record(
    plan: Plan, instruments: Sequence[Instrument[Any]], station: str, foreign: set[str]
) -> None:
    """Record one station into the folder; CaptureError where it breaks off."""
    from ..io import recording_station

    begun = time.time()
    try:
        with recording_station(
            plan.survey, station, epoch=_epoch(plan.survey, begun), keep_raw=plan.keep_raw
        ) as recording:
            report = _take(plan, instruments, station, recording)
            recording.finish(
                complete=report.problem is None, log=_log(instruments, report, begun, plan)
            )
    except Interrupted:
        kept = "what it has is kept, and the same command records it again"
        typer.echo(f"station {station} broke off: {kept}", err=True)
        raise
    print_station(f"station {station}", report)
    heard = [anchor.anchor for anchor in report.live.anchors if anchor.count]
    ask_heights(plan.survey, heard, foreign)
    if report.problem is not None:
        raise report.problem


def _record_upper(
    plan: Plan, instruments: Sequence[Instrument[Any]], station: str, height_m: float
) -> None:
    """Record the raised scan of a station with the scanner alone; CaptureError where it breaks off."""
    from ..io import recording_upper_scan

    begun = time.time()
    scanners = [item for item in instruments if item.device.sample_hz is not None]
    with recording_upper_scan(
        plan.survey,
        station,
        height_m=height_m,
        epoch=_epoch(plan.survey, begun),
        keep_raw=plan.keep_raw,
    ) as recording:
        report = _take(plan, scanners, f"{station}, raised", recording)
        recording.finish(complete=report.problem is None, log=_log(scanners, report, begun, plan))
    print_station(f"station {station}, raised scan", report)
    if report.problem is not None:
        raise report.problem


def _take(
    plan: Plan, instruments: Sequence[Instrument[Any]], title: str, sink: Sink
) -> StationReport:
    from ..capture.recorder import record_station

    with live_screen(title) as watch:
        return record_station(instruments, plan.seconds, sink, watch=watch, clock=plan.clock)


def _epoch(survey: Path, begun: float) -> float:
    """S from the survey's zero of time."""
    from ..io import read_time_zero

    zero = read_time_zero(survey)
    return begun - zero.timestamp() if zero is not None else 0.0


def _log(
    instruments: Sequence[Instrument[Any]], report: StationReport, begun: float, plan: Plan
) -> dict[str, Any]:
    """What a later look at a recording needs to know of it."""
    scan = report.live.scan
    return {
        "begun_utc": datetime.fromtimestamp(begun, UTC).isoformat(timespec="milliseconds"),
        "begun_monotonic_s": plan.clock.now(),
        "seconds_asked": plan.seconds,
        "seconds": report.live.elapsed,
        "problem": None if report.problem is None else str(report.problem),
        "doubts": list(report.doubts),
        "instruments": [
            {
                "device": item.device.name,
                "port": item.port.name,
                "baud": item.device.baud,
                **item.identity,
            }
            for item in instruments
        ],
        "angle_convention": "counter-clockwise seen from above, 0 at the forward mark",
        "scan": None if scan is None else _finite(asdict(scan)),
        "anchors": [_finite(asdict(anchor)) for anchor in report.live.anchors],
    }


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and v != v else v for k, v in row.items()}
