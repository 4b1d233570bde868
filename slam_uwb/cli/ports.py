"""``slam-uwb ports``: what is plugged in."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from .options import JsonOption, VerboseOption

if TYPE_CHECKING:
    from ..capture.ports.device import Device


def ports(as_json: JsonOption = False, _verbose: VerboseOption = False) -> None:
    """List serial ports and the instruments that may be there.

    `slam-uwb record --lidar sweep:NAME` takes a port's name or its identifiers `vendor:product[:serial]`.
    """
    from ..capture.ports import LIDARS, TAGS
    from ..capture.ports.find import candidates, list_ports

    devices: list[Device[Any]] = [*LIDARS.values(), *TAGS.values()]
    found = [(port, candidates(port, devices)) for port in list_ports()]
    if as_json:
        rows = [asdict(port) | {"usb": port.usb_name, "maybe": names} for port, names in found]
        typer.echo(json.dumps(rows, indent=2))
        return
    for port, names in found:
        maybe = f"  maybe {', '.join(names)}" if names else ""
        typer.echo(f"{port.name}  {port.usb_name or 'no USB'}  {port.description}{maybe}")
    if not found:
        typer.echo("no serial ports")
    typer.echo(f"lidars: {', '.join(LIDARS)}; tags: {', '.join(TAGS)}")
