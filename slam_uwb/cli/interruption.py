"""Ctrl-C, kill and a closed terminal end a command the same way, after writers cleaned up."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """Not an Exception: nothing that goes on after one bad pair or link may go on after this."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise `Interrupted` at the first signal; the next one ends the process at once."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in before.items():
        # A job started in the background or under nohup is meant to ignore them.
        if handler is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    raise Interrupted
