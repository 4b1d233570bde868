"""Put emulated devices on pseudo-terminals, where any program takes them for serial ports."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from ..clock import REAL_TIME, Clock
from .faults import NO_FAULTS, Faults

_TICK_S = 0.002
"""Of the host."""
_PAUSE_S = 2.0
"""Without anything due for so long, what comes next is a stream of its own."""
_MAX_PENDING = 4_000_000
"""Bytes that nobody fetches; more is lost, as in a real adapter."""


class Emulated(Protocol):
    """A device: bytes in, bytes out, and a stream that depends on the time alone."""

    def power_on(self, now: float) -> None:
        """It is plugged in."""

    def receive(self, data: bytes, now: float) -> bytes:
        """The answer to what the host sent."""

    def stream(self, now: float) -> bytes:
        """What it sends by itself up to now."""


@dataclass(slots=True)
class _Plug:
    """One device on one pseudo-terminal, or unplugged."""

    device: Emulated
    path: Path
    """A link to the terminal of the moment, as udev makes them."""
    faults: Mapping[Path, Faults]
    """By path; looked up at every stream, so that they may change."""
    rng: np.random.Generator
    master: int = -1
    slave: int = -1
    streamed_from: float = -1e9
    streamed_at: float = -1e9
    pending: bytes = b""
    back_at: float | None = None
    spent: Faults | None = field(default=None)
    """Those whose cable was pulled already."""

    def plug_in(self, now: float) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.device.power_on(now)
        self.pending, self.streamed_at, self.back_at = b"", -1e9, None
        self.path.symlink_to(os.ttyname(self.slave))

    def pull_out(self) -> None:
        self.path.unlink(missing_ok=True)
        for number in (self.master, self.slave):
            with suppress(OSError):
                os.close(number)
        self.master = -1

    def serve(self, now: float) -> None:
        """Pass on what is due."""
        if self.master < 0:
            if self.back_at is not None and now >= self.back_at:
                self.plug_in(now)
            return
        with suppress(BlockingIOError):
            request = os.read(self.master, 4096)
            self.pending += self.device.receive(request, now)
        self._stream(now)
        if self.master < 0:
            return
        with suppress(BlockingIOError):
            self.pending = self.pending[os.write(self.master, self.pending) :]
        self.pending = self.pending[:_MAX_PENDING]

    def unread(self) -> int:
        """Bytes on their way to the host."""
        if self.master < 0:
            return 0
        waiting = fcntl.ioctl(self.slave, termios.FIONREAD, bytes(4))
        return len(self.pending) + int.from_bytes(waiting, sys.byteorder)

    def _stream(self, now: float) -> None:
        data = self.device.stream(now)
        if not data:
            return
        faults = self.faults.get(self.path, NO_FAULTS)
        paused = now - self.streamed_at > _PAUSE_S
        self.streamed_from, self.streamed_at = now if paused else self.streamed_from, now
        age = now - self.streamed_from
        if faults.unplug_at is not None and faults is not self.spent and age >= faults.unplug_at:
            self.spent, self.back_at = faults, now + faults.replug_after
            self.pull_out()
        elif faults.stall_at is None or age < faults.stall_at:
            self.pending += faults.spoil(data, self.rng)


@contextmanager
def plugged_in(
    devices: Mapping[Path, Emulated],
    *,
    clock: Clock = REAL_TIME,
    faults: Mapping[Path, Faults] | None = None,
    seed: int = 0,
    after_round: Callable[[int], None] = lambda _unread: None,
) -> Iterator[None]:
    """The devices answer at these paths while inside; a thread plays them.

    Args:
        devices: by the path at which a port appears; nothing may be there.
        clock: of the devices.
        faults: by path.
        seed: of the damage.
        after_round: called each time that all devices had their turn, with the bytes that the host has
            not fetched yet.
    """
    chosen = {} if faults is None else faults
    plugs = [
        _Plug(device, path, chosen, np.random.default_rng((seed, number)))
        for number, (path, device) in enumerate(devices.items())
    ]
    stop = threading.Event()
    thread = threading.Thread(
        target=_serve, args=(plugs, clock, stop, after_round), name="emulator", daemon=True
    )
    try:
        for plug in plugs:
            plug.plug_in(clock.now())
        thread.start()
        yield
    finally:
        stop.set()
        if thread.is_alive():
            thread.join(2.0)
        for plug in plugs:
            plug.pull_out()


def _serve(
    plugs: list[_Plug], clock: Clock, stop: threading.Event, after_round: Callable[[int], None]
) -> None:
    while not stop.is_set():
        for plug in plugs:
            plug.serve(clock.now())
        after_round(sum(plug.unread() for plug in plugs))
        numbers = [plug.master for plug in plugs if plug.master >= 0]
        select.select(numbers, [], [], 0.0)
        stop.wait(_TICK_S)
