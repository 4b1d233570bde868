"""``slam-uwb record``: station by station, from the instruments to a survey folder."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import VerboseOption
from .recording_guide import ask_heights, ask_number, ask_reconnect, ask_station
from .recording_screen import live_screen, print_station, print_survey_so_far

if TYPE_CHECKING:
    from ..capture.clock import Clock
    from ..capture.ports.device import Device
    from ..capture.ports.session import Instrument
    from ..capture.recorder import StationReport


@dataclass(frozen=True, slots=True)
class _Plan:
    """What the whole session goes by."""

    survey: Path
    devices: tuple[tuple[Device[Any], str], ...]
    """With the port as the operator named it."""
    seconds: float
    keep_raw: bool
    solve: bool
    clock: Clock


_SurveyArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SURVEY",
        show_default=False,
        help="Survey folder to make, or to go on with: stations are added.",
    ),
]
_LidarOption = Annotated[
    str | None,
    typer.Option(
        metavar="DEVICE[:PORT]",
        show_default=False,
        help="Scanner and its port, e.g. `sweep:/dev/ttyUSB0`, `sweep:0403:6015` (USB "
        "identifiers) or `sweep` (the only port that fits). `slam-uwb ports` lists both.",
    ),
]
_TagOption = Annotated[
    str | None,
    typer.Option(
        metavar="DEVICE[:PORT]", show_default=False, help="UWB tag and its port, likewise."
    ),
]
_SecondsOption = Annotated[
    float, typer.Option(min=1.0, max=7200.0, metavar="S", help="Recorded at each station.")
]
_TagHeightOption = Annotated[
    float | None,
    typer.Option(
        metavar="M", show_default=False, help="Tag antenna above the floor; asked if not given."
    ),
]
_MaxRangeOption = Annotated[
    float | None,
    typer.Option(
        min=1.0,
        max=1000.0,
        metavar="M",
        show_default="what the scanner reaches",
        help="Longer returns are taken for none.",
    ),
]
_RawOption = Annotated[
    bool, typer.Option("--raw", help="Keep the bytes as they came, in recordings/raw.")
]
_NoSolveOption = Annotated[
    bool, typer.Option("--no-solve", help="Do not solve the survey after each station.")
]
_SpeedOption = Annotated[
    float,
    typer.Option(
        min=1.0, max=100.0, metavar="K", help="Of the clock, for `slam-uwb emulate --speed K`."
    ),
]


def record(
    survey: _SurveyArgument,
    lidar: _LidarOption = None,
    uwb: _TagOption = None,
    seconds: _SecondsOption = 60.0,
    tag_height_m: _TagHeightOption = None,
    max_range_m: _MaxRangeOption = None,
    raw: _RawOption = False,
    no_solve: _NoSolveOption = False,
    speed: _SpeedOption = 1.0,
    _verbose: VerboseOption = False,
) -> None:
    """Record a survey with instruments, station by station.

    Everything is written as it arrives. A recording that breaks off stays, marked `complete = false`,
    and can be recorded again. Motors are stopped however this ends.
    """
    from ..capture.clock import Clock
    from ..capture.ports import LIDARS, TAGS

    devices = tuple(
        _device(given, known, option)
        for given, known, option in ((lidar, LIDARS, "--lidar"), (uwb, TAGS, "--uwb"))
        if given is not None
    )
    if not devices:
        raise typer.BadParameter("name at least one instrument: --lidar, --uwb")
    _start(survey, devices, tag_height_m, max_range_m)
    plan = _Plan(survey, devices, seconds, raw, not no_solve, Clock(speed))
    while _run_session(plan):
        pass


def _device(given: str, known: dict[str, Any], option: str) -> tuple[Device[Any], str]:
    name, _, port = given.partition(":")
    if name not in known:
        raise typer.BadParameter(
            f"{name!r}: expected DEVICE[:PORT], DEVICE one of {', '.join(known)}", param_hint=option
        )
    return known[name], port


def _start(
    survey: Path,
    devices: tuple[tuple[Device[Any], str], ...],
    tag_height_m: float | None,
    max_range_m: float | None,
) -> None:
    """Make the survey folder, or look whether it can be gone on with."""
    from ..io import check_height, start_survey

    scanner = next((device for device, _ in devices if device.sample_hz is not None), None)
    lidar: dict[str, Any] = {}
    if scanner is not None:
        reach = max_range_m or scanner.max_range_m or 40.0
        lidar = {"model": scanner.title, "angle_direction": "ccw", "max_range_m": float(reach)}
    tag: dict[str, Any] = {}
    if any(device.sample_hz is None for device, _ in devices):
        if tag_height_m is not None:
            check_height(tag_height_m)
        elif not _knows_tag(survey):
            tag_height_m = ask_number(
                "Height of the tag's antenna above the floor in m", check_height
            )
        if tag_height_m is not None:
            tag = {"height_m": tag_height_m}
    start_survey(survey, time_zero=datetime.now(UTC), lidar=lidar, tag=tag)


def _knows_tag(survey: Path) -> bool:
    import tomllib

    try:
        return "tag" in tomllib.loads((survey / "survey.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False


def _run_session(plan: _Plan) -> bool:
    """Stations until the operator ends (False) or an instrument has to be connected again (True)."""
    from ..capture.ports import connected
    from ..capture.ports.find import find_port
    from ..capture.signals import signals_held
    from ..model.errors import CaptureError

    try:
        # Signals outlast the instruments: a second one must not come between the first and the motor's stop.
        with signals_held(), ExitStack() as stack:
            instruments = []
            for device, wanted in plan.devices:
                typer.echo(f"connecting the {device.title} ...")
                port = find_port(device, wanted)
                instruments.append(stack.enter_context(connected(device, port, plan.clock)))
                _print_identity(instruments[-1])
            while (station := ask_station(plan.survey)) is not None:
                report = _record(plan, instruments, station)
                if report.problem is not None:
                    raise report.problem
                if plan.solve:
                    _solve_so_far(plan.survey, station)
            return False
    except CaptureError as error:
        if not ask_reconnect(error):
            raise
        return True


def _print_identity(instrument: Instrument[Any]) -> None:
    facts = dict(instrument.identity)
    warning = facts.pop("warning", None)
    typer.echo(f"{instrument.name}: " + ", ".join(f"{k} {v}" for k, v in facts.items()))
    if warning:
        typer.echo(f"warning: {warning}", err=True)


def _record(plan: _Plan, instruments: list[Instrument[Any]], station: str) -> StationReport:
    """Record one station into the folder."""
    from ..capture.recorder import record_station
    from ..io import read_time_zero, recording_station

    begun = time.time()
    zero = read_time_zero(plan.survey)
    epoch = begun - zero.timestamp() if zero is not None else 0.0
    with recording_station(plan.survey, station, epoch=epoch, keep_raw=plan.keep_raw) as recording:
        with live_screen(station) as watch:
            report = record_station(
                instruments, plan.seconds, recording, watch=watch, clock=plan.clock
            )
        recording.finish(
            complete=report.problem is None, log=_log(instruments, report, begun, plan)
        )
    print_station(station, report)
    ask_heights(plan.survey, [anchor.anchor for anchor in report.live.anchors if anchor.count])
    return report


def _log(
    instruments: list[Instrument[Any]], report: StationReport, begun: float, plan: _Plan
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


def _solve_so_far(survey: Path, station: str) -> None:
    """Solve what there is and show it; a survey that cannot be solved yet is no error."""
    from ..capture.signals import signals_let_in
    from ..io import read_survey, recorded_stations
    from ..model.errors import SlamUwbError
    from ..pipeline import solve_survey
    from .progress import progress_bar

    if sum(bool(item.files) for item in recorded_stations(survey).values()) < 2:
        return
    try:
        with signals_let_in(), progress_bar() as progress:
            solution = solve_survey(read_survey(survey), progress=progress)
    except SlamUwbError as error:
        typer.echo(f"the survey so far: {error}")
        return
    print_survey_so_far(solution, station)
