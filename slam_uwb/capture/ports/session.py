"""Instruments in use: opened, prepared, and laid to rest whatever happens."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Generic

from ...model.errors import CaptureError
from ..clock import REAL_TIME, Clock
from ..samples import Samples_co
from ..signals import unhurried
from .device import Device, Identity
from .port import Port, open_port


@dataclass(frozen=True, slots=True)
class Instrument(Generic[Samples_co]):
    """A device on an open port, ready to be started."""

    device: Device[Samples_co]
    port: Port
    identity: Identity

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.device.title} on {self.port.name}"


@contextmanager
def connected(
    device: Device[Samples_co], port_name: str, clock: Clock = REAL_TIME
) -> Iterator[Instrument[Samples_co]]:
    """Open and prepare an instrument; its stream and motor are off when this is left, however it is left.

    Raises:
        CaptureError: the port cannot be opened, or what answers is not the instrument.
    """
    with ExitStack() as stack:
        port = open_port(port_name, device.baud, dtr=device.dtr, clock=clock)
        stack.callback(port.close)
        # From the first byte sent: an interrupt while the motor spins up must stop it too.
        stack.callback(_lay_to_rest, device, port)
        yield Instrument(device, port, device.prepare(port))


@contextmanager
def streaming(instrument: Instrument[Any]) -> Iterator[None]:
    """The instrument's stream runs inside."""
    try:
        instrument.device.begin(instrument.port)
        yield
    finally:
        with unhurried(), suppress(CaptureError):
            instrument.device.end(instrument.port)


def _lay_to_rest(device: Device[Any], port: Port) -> None:
    # What is gone cannot be stopped, and must not hide the error that ends the session.
    with unhurried(), suppress(CaptureError):
        device.rest(port)
