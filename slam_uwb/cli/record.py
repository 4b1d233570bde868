"""``slam-uwb record``: station by station, from the instruments to a survey folder."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import VerboseOption
from .recording_guide import ask_number
from .recording_session import Plan, run_sessions

if TYPE_CHECKING:
    from ..capture.ports.device import Device


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
_UpperOption = Annotated[
    bool,
    typer.Option(
        "--upper", help="At each station a second scan with the scanner raised above the furniture."
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
    upper: _UpperOption = False,
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
    if upper and lidar is None:
        raise typer.BadParameter("a raised scan needs a scanner: --lidar", param_hint="--upper")
    _start(survey, devices, tag_height_m, max_range_m)
    run_sessions(Plan(survey, devices, seconds, upper, raw, not no_solve, Clock(speed)))


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
