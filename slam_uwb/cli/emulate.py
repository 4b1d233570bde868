"""``slam-uwb emulate``: a survey played by instruments that are not there."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from .options import SurveyArgument, VerboseOption


def emulate(
    survey: SurveyArgument,
    ports: Annotated[
        Path,
        typer.Option(
            metavar="DIR",
            show_default=False,
            help="Folder in which the ports appear, as DIR/sweep and DIR/dwm1001.",
        ),
    ],
    speed: Annotated[
        float, typer.Option(min=1.0, max=100.0, metavar="K", help="Times real time.")
    ] = 1.0,
    noise: Annotated[
        float, typer.Option(min=0.0, max=0.5, metavar="P", help="Share of bytes with a wrong bit.")
    ] = 0.0,
    torn: Annotated[
        float,
        typer.Option(min=0.0, max=0.5, metavar="P", help="Share of bytes lost, with neighbours."),
    ] = 0.0,
    stall_at_s: Annotated[
        float | None,
        typer.Option(min=0.0, metavar="S", show_default=False, help="The scanner falls silent."),
    ] = None,
    unplug_at_s: Annotated[
        float | None,
        typer.Option(
            min=0.0, metavar="S", show_default=False, help="The scanner is unplugged, once."
        ),
    ] = None,
    replug_after_s: Annotated[
        float, typer.Option(min=0.0, metavar="S", help="And plugged in again.")
    ] = 1.0,
    _verbose: VerboseOption = False,
) -> None:
    """Play a survey as a Scanse Sweep and a DWM1001 do, on pseudo-terminals, until interrupted.

    Each recording of at least nine tenths of a station's length moves the tripod to the next station.
    Anchors whose names are not four hexadecimal digits report as D001, D002, ...
    """
    from ..capture.clock import Clock
    from ..capture.emulator import (
        Dwm1001Emulator,
        Faults,
        SweepEmulator,
        play_survey,
        plugged_in,
        radio_names,
    )
    from ..capture.emulator.sweep import SAMPLE_HZ
    from ..capture.emulator.terminal import Emulated
    from ..io import read_survey

    played = read_survey(survey)
    tripod = play_survey(played, SAMPLE_HZ)
    ports.mkdir(parents=True, exist_ok=True)
    faults = Faults(
        noise=noise,
        torn=torn,
        stall_at=stall_at_s,
        unplug_at=unplug_at_s,
        replug_after=replug_after_s,
    )
    sweep, tag = ports / "sweep", ports / "dwm1001"
    devices: dict[Path, Emulated] = {sweep: SweepEmulator(tripod), tag: Dwm1001Emulator(tripod)}
    with plugged_in(devices, clock=Clock(speed), faults={sweep: faults}):
        typer.echo(f"lidar  sweep:{sweep}")
        typer.echo(f"uwb    dwm1001:{tag}")
        for anchor, radio in radio_names(played).items():
            typer.echo(f"anchor {anchor} reports as {radio}")
        while True:
            time.sleep(0.2)
