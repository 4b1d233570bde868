"""Signals while instruments run: they wait, and strike only where nothing can be left half-done.

A handler that raises between any two instructions can lose the call that stops a motor, leave a lock held,
or be swallowed by a destructor. So signals are noted here, and looked up at chosen places.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(slots=True)
class _Gate:
    """Where signals wait. Its `receive` is the handler, so that `getsignal` finds it."""

    before: dict[int, Any]
    """Handlers by signal."""
    patient: bool
    """True where they wait until the end whatever happens."""
    open: bool = False
    arrived: list[int] = field(default_factory=list)

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """The handler of all signals."""
        if self.open:
            self.strike(number)
        else:
            self.arrived.append(number)

    def strike(self, number: int) -> None:
        """As it would have without the gate, which stands again afterwards."""
        self.restore()
        try:
            signal.raise_signal(signal.Signals(number))
        finally:
            self.install()

    def install(self) -> None:
        for number in self.before:
            signal.signal(number, self.receive)

    def restore(self) -> None:
        for number, handler in self.before.items():
            signal.signal(number, handler)


@contextmanager
def signals_held() -> Iterator[None]:
    """Inside, signals wait for `strike_now`, `signals_let_in` or the end, whichever comes first."""
    with _gate(patient=False):
        yield


@contextmanager
def unhurried() -> Iterator[None]:
    """Inside, signals wait for the end: a motor is being stopped, which takes a second or so."""
    with _gate(patient=True):
        yield


def strike_now() -> None:
    """Let a signal strike that has arrived; nothing where signals are not held."""
    gate = _present_gate()
    if gate is not None and gate.arrived and not gate.patient:
        gate.strike(gate.arrived.pop(0))


@contextmanager
def signals_let_in() -> Iterator[None]:
    """Inside, signals strike at once: while a person is waited for, or work is done that may break off."""
    gate = _present_gate()
    if gate is None or gate.patient:
        yield
        return
    # Opened first: what arrives between the two lines strikes by itself.
    gate.open = True
    try:
        strike_now()
        yield
    finally:
        gate.open = False


@contextmanager
def _gate(*, patient: bool) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in _SIGNALS}
    # A job under nohup is meant to ignore them; None was set outside Python.
    gate = _Gate(
        {n: h for n, h in handlers.items() if h not in (signal.SIG_IGN, None)}, patient=patient
    )
    try:
        gate.install()
        yield
    finally:
        gate.restore()
        if gate.arrived:
            signal.raise_signal(signal.Signals(gate.arrived[0]))


def _present_gate() -> _Gate | None:
    """The innermost one that signals arrive at; None in other threads, which no signal reaches."""
    if threading.current_thread() is not threading.main_thread():
        return None
    owners = (getattr(signal.getsignal(number), "__self__", None) for number in _SIGNALS)
    return next((owner for owner in owners if isinstance(owner, _Gate)), None)
