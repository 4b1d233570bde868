"""Which serial ports there are, and which of them may be an instrument's."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...model.errors import CaptureError
from .device import Device
from .port import import_serial

_USB = re.compile(r"([0-9A-Fa-f]{4}):([0-9A-Fa-f]{4})(?::(.+))?", re.ASCII)


@dataclass(frozen=True, slots=True)
class FoundPort:
    """A serial port of this machine."""

    name: str
    usb: tuple[int, int] | None
    """(vendor, product); None for a port that is no USB adapter."""
    serial_number: str
    description: str

    @property
    def usb_name(self) -> str:
        """As it is given on the command line: vendor:product[:serial]."""
        if self.usb is None:
            return ""
        number = f":{self.serial_number}" if self.serial_number else ""
        return f"{self.usb[0]:04x}:{self.usb[1]:04x}{number}"


def list_ports() -> tuple[FoundPort, ...]:
    """The serial ports, by name."""
    import_serial()
    from serial.tools.list_ports import comports

    ports = (
        FoundPort(
            str(port.device),
            None if port.vid is None or port.pid is None else (port.vid, port.pid),
            str(port.serial_number or ""),
            str(port.description or ""),
        )
        for port in comports()
    )
    return tuple(sorted(ports, key=lambda port: port.name))


def candidates(port: FoundPort, devices: Sequence[Device[Any]]) -> tuple[str, ...]:
    """Names of the instruments that come with such an adapter: a hint, since adapters are common."""
    return tuple(device.name for device in devices if port.usb in device.usb)


def find_port(device: Device[Any], wanted: str, ports: Sequence[FoundPort] | None = None) -> str:
    """The name of the port that is meant.

    Args:
        device: what should be there.
        wanted: a port's name, USB identifiers ``vendor:product[:serial]`` (hexadecimal), or empty: the
            only port with an adapter that the device comes with.
        ports: to choose from; those of this machine where None.

    Raises:
        CaptureError: none fits, or several do.
    """
    usb = _USB.fullmatch(wanted)
    if wanted and usb is None:
        return wanted
    there = list_ports() if ports is None else ports
    if usb is None:
        fitting = [port for port in there if port.usb in device.usb]
    else:
        pair = (int(usb[1], 16), int(usb[2], 16))
        fitting = [p for p in there if p.usb == pair and usb[3] in (None, p.serial_number)]
    if len(fitting) == 1:
        return fitting[0].name
    asked = wanted or device.title
    if not fitting:
        raise CaptureError(asked, "no such USB port; `slam-uwb ports` lists what is plugged in")
    names = ", ".join(f"{port.name} ({port.usb_name})" for port in fitting)
    raise CaptureError(asked, f"several ports fit, name one: {names}")
