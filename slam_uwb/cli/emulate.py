"""``slam-uwb emulate``: a survey played by instruments that are not there."""

from __future__ import annotations

import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from .options import SurveyArgument, VerboseOption

if TYPE_CHECKING:
    from ..capture.clock import Clock
    from ..capture.emulator import Faults
    from ..capture.emulator.terminal import Emulated
    from ..model.survey import Survey


_PortsOption = Annotated[
    Path,
    typer.Option(
        metavar="DIR",
        show_default=False,
        help="Folder in which the ports appear, as DIR/sweep (or DIR/rplidar-c1-dense) and "
        "DIR/dwm1001.",
    ),
]


class EmulatedLidar(StrEnum):
    """Scanners that can be played."""

    SWEEP = "sweep"
    RPLIDAR = "rplidar-c1-dense"


_LidarOption = Annotated[
    EmulatedLidar,
    typer.Option(metavar="DEVICE", help="Which scanner is played: sweep or rplidar-c1-dense."),
]
_SpeedOption = Annotated[
    float, typer.Option(min=1.0, max=100.0, metavar="K", help="Times real time.")
]
_NoiseOption = Annotated[
    float, typer.Option(min=0.0, max=0.5, metavar="P", help="Share of bytes with a wrong bit.")
]
_TornOption = Annotated[
    float,
    typer.Option(min=0.0, max=0.5, metavar="P", help="Share of bytes lost, with neighbours."),
]
_StallOption = Annotated[
    float | None,
    typer.Option(min=0.0, metavar="S", show_default=False, help="The scanner falls silent."),
]
_UnplugOption = Annotated[
    float | None,
    typer.Option(min=0.0, metavar="S", show_default=False, help="The scanner is unplugged, once."),
]
_ReplugOption = Annotated[float, typer.Option(min=0.0, metavar="S", help="And plugged in again.")]

_UpperOption = Annotated[
    bool,
    typer.Option("--upper", help="Each station's upper scan follows it, for `record --upper`."),
]


def emulate(
    survey: SurveyArgument,
    ports: _PortsOption,
    lidar: _LidarOption = EmulatedLidar.SWEEP,
    speed: _SpeedOption = 1.0,
    noise: _NoiseOption = 0.0,
    torn: _TornOption = 0.0,
    stall_at_s: _StallOption = None,
    unplug_at_s: _UnplugOption = None,
    replug_after_s: _ReplugOption = 1.0,
    upper: _UpperOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Play a survey as the instruments would that recorded it.

    A Scanse Sweep (or an RPLIDAR) and a DWM1001 on pseudo-terminals, until interrupted. Each recording of at least
    nine tenths of a station's length moves the tripod to the next station. Anchors whose names are
    not four hexadecimal digits report as D001, D002, ...
    """
    from ..capture.clock import Clock
    from ..capture.emulator import Faults
    from ..io import read_survey

    faults = Faults(
        noise=noise,
        torn=torn,
        stall_at=stall_at_s,
        unplug_at=unplug_at_s,
        replug_after=replug_after_s,
    )
    _play(read_survey(survey), ports, lidar, Clock(speed), faults, upper=upper)


def _play(
    survey: Survey,
    ports: Path,
    lidar: EmulatedLidar,
    clock: Clock,
    scanner_faults: Faults,
    *,
    upper: bool,
) -> NoReturn:
    """Both instruments at their ports, until interrupted."""
    from ..capture.emulator import (
        Dwm1001Emulator,
        RplidarEmulator,
        SweepEmulator,
        play_survey,
        plugged_in,
        radio_names,
    )
    from ..capture.emulator.sweep import SAMPLE_HZ

    tripod = play_survey(survey, SAMPLE_HZ, upper=upper)
    ports.mkdir(parents=True, exist_ok=True)
    scanner, tag = ports / lidar.value, ports / "dwm1001"
    played = RplidarEmulator if lidar is EmulatedLidar.RPLIDAR else SweepEmulator
    devices: dict[Path, Emulated] = {scanner: played(tripod), tag: Dwm1001Emulator(tripod)}
    with plugged_in(devices, clock=clock, faults={scanner: scanner_faults}):
        typer.echo(f"lidar  {lidar.value}:{scanner}")
        typer.echo(f"uwb    dwm1001:{tag}")
        for anchor, radio in radio_names(survey).items():
            typer.echo(f"anchor {anchor} reports as {radio}")
        while True:
            time.sleep(0.2)
