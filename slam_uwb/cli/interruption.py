"""Ctrl-C, kill and a closed terminal end a command the same way, after writers cleaned up."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_AGAIN_S = 0.02
"""After an interrupt was lost; by then what lost it has returned."""


class Interrupted(BaseException):
    """Not an Exception: nothing that goes on after one bad pair or link may go on after this."""


@contextmanager
def interruptible() -> Iterator[list[int]]:
    """Raise `Interrupted` at the first signal; the next one ends the process at once.

    Yields the signals that came. An error may be no more than the trace of one: a lock's own code was hit,
    or a library made an error of its own of it.
    """
    before = {number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGALRM)}
    # A job started in the background or under nohup is meant to ignore them.
    heard = [number for number in SIGNALS if before[number] is not signal.SIG_IGN]
    came: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        for other in heard:
            signal.signal(other, signal.SIG_DFL)
        raise Interrupted

    def send_again() -> None:
        for number in heard:
            # Where it is not the default, somebody holds signals back and passes them on to us.
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, interrupt)
        # By the system's timer: a thread would need locks that the destructor may have interrupted.
        signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.Signals(came[-1])))
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)

    for number in heard:
        signal.signal(number, interrupt)
    try:
        with _seeing_lost_ones(send_again):
            yield came
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _seeing_lost_ones(send_again: Callable[[], None]) -> Iterator[None]:
    """Python passes over whatever is raised in a destructor or in a weak reference's callback."""
    before = sys.unraisablehook

    def see(lost: UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, Interrupted):
            send_again()
        else:
            before(lost)

    sys.unraisablehook = see
    try:
        yield
    finally:
        sys.unraisablehook = before
