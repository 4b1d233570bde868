"""The time that instruments and recordings go by; an emulated instrument may run faster."""

from __future__ import annotations

import time
from dataclasses import dataclass

_HOST_S = 5.0
"""A busy host may leave an emulator waiting for that long."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Monotonic seconds; `speed` of them pass in a second of the host."""

    speed: float = 1.0

    def now(self) -> float:
        """S since some moment."""
        return time.monotonic() * self.speed

    def sleep(self, duration: float) -> None:
        """Wait so many of this clock's seconds."""
        time.sleep(max(duration, 0.0) / self.speed)

    def patience(self, limit: float) -> float:
        """`limit`; for a hurried clock some seconds of the host, which does not get faster with it."""
        return limit if self.speed == 1.0 else max(limit, _HOST_S * self.speed)


REAL_TIME = Clock()
