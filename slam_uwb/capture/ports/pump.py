"""Read the ports in a thread of its own: serial buffers overflow while a disk makes the program wait."""

from __future__ import annotations

import queue
import select
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

from ...model.errors import CaptureError
from .port import Port

_POLL_S = 0.05
_PAUSE_S = 0.005
"""Between reads: fewer, larger chunks; an adapter holds its bytes back for some ms as well."""
_MAX_WAITING = 4_096
"""Chunks; a program that does not fetch them for minutes is stuck."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """What one port gave at one moment."""

    port: Port
    time: float
    """S of the port's clock when it was read."""
    data: bytes


Arrival: TypeAlias = Chunk | CaptureError


@dataclass(frozen=True, slots=True)
class Pump:
    """What the reading thread shares."""

    arrivals: queue.Queue[Arrival]
    """A `CaptureError` in it is the last thing that comes."""
    reading: threading.Lock
    """Held from before bytes are taken from a port until they are in the queue."""

    def nothing_waits(self, port: Port) -> bool:
        """True where all that has arrived at the port was fetched: a busy host is no silent instrument."""
        with self.reading:
            return self.arrivals.empty() and not port.has_waiting()


@contextmanager
def pumping(ports: Sequence[Port]) -> Iterator[Pump]:
    """Ports are read while inside."""
    pump = Pump(queue.Queue(_MAX_WAITING), threading.Lock())
    stop = threading.Event()
    thread = threading.Thread(
        target=_read_ports, args=(ports, pump, stop), name="serial ports", daemon=True
    )
    thread.start()
    try:
        yield pump
    finally:
        stop.set()
        thread.join(2.0)


def _read_ports(ports: Sequence[Port], pump: Pump, stop: threading.Event) -> None:
    try:
        numbers = {port.fileno(): port for port in ports}
        pause = _PAUSE_S / max(1.0, *(port.clock.speed for port in ports))
        while not stop.is_set():
            ready, _, _ = select.select(list(numbers), [], [], _POLL_S)
            for number in ready:
                port = numbers[number]
                with pump.reading:
                    data = port.read_available()
                    if data:
                        pump.arrivals.put(Chunk(port, port.clock.now(), data), timeout=1.0)
            stop.wait(pause)
    except CaptureError as error:
        pump.arrivals.put(error)
    except (OSError, ValueError, queue.Full) as error:
        names = ", ".join(port.name for port in ports)
        pump.arrivals.put(CaptureError(names, f"reading failed: {error}"))
