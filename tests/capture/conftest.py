"""Real pyserial ports at emulated instruments, on a clock that runs faster than the host's."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from slam_uwb.capture.clock import Clock
from slam_uwb.capture.emulator import (
    Dwm1001Emulator,
    Faults,
    SweepEmulator,
    Tripod,
    play_survey,
    plugged_in,
)
from slam_uwb.capture.ports import LIDARS, TAGS, Instrument, connected
from slam_uwb.model.survey import Survey
from slam_uwb.simulate import Lidar, Radio, simulate_survey

PUMP = "serial ports"
"""The thread that fetches bytes while a recording runs."""
MAX_UNREAD = 1000
"""Bytes; 0.3 s of a Sweep. While a recording runs there may be none: they are dated when they are fetched."""
MAX_HOLD_S = 0.3
"""Of the host, at a stretch, outside a recording: while one instrument is stopped, nobody listens to the other."""


class SteppedClock(Clock):
    """Passes while the emulator runs and the host keeps up: a busy machine makes a test slow, not wrong."""

    __slots__ = ("held_since", "moment")

    def __init__(self, speed: float) -> None:
        super().__init__(speed)
        object.__setattr__(self, "moment", 1000.0)
        object.__setattr__(self, "held_since", None)

    def now(self) -> float:
        return self.moment

    def sleep(self, duration: float) -> None:
        end = self.moment + duration
        while self.moment < end:
            time.sleep(0.0005)

    def patience(self, limit: float) -> float:
        return limit

    def step(self, unread: int) -> None:
        """After a round of the emulator. Waits until all bytes are fetched as long as somebody fetches them."""
        if unread and any(thread.name == PUMP for thread in threading.enumerate()):
            return
        since = self.held_since if unread > MAX_UNREAD else None
        if unread > MAX_UNREAD and since is None:
            since = time.monotonic()
        object.__setattr__(self, "held_since", since)
        if since is not None and time.monotonic() - since < MAX_HOLD_S:
            return
        object.__setattr__(self, "moment", self.moment + 0.002 * self.speed)


@dataclass(frozen=True)
class Bench:
    """Two instruments that may be connected."""

    sweep: SweepEmulator
    tag: Dwm1001Emulator
    folder: Path
    clock: Clock
    faults: dict[Path, Faults]

    @contextmanager
    def connect(self) -> Iterator[list[Instrument]]:
        with ExitStack() as stack:
            yield [
                stack.enter_context(connected(device, str(self.folder / name), self.clock))
                for device, name in ((LIDARS["sweep"], "sweep"), (TAGS["dwm1001"], "tag"))
            ]

    def unplug_sweep(self, at: float) -> None:
        """Pull its cable so many s into the next stream; it comes back soon after."""
        self.faults[self.folder / "sweep"] = Faults(unplug_at=at, replug_after=2.0)

    def await_sweep(self) -> None:
        deadline = time.monotonic() + 5.0
        while not (self.folder / "sweep").exists():
            assert time.monotonic() < deadline
            time.sleep(0.005)


def short_survey(scene: str, seed: int, seconds: float) -> Survey:
    lidar = Lidar(duration=seconds, upper_duration=0.0)
    return simulate_survey(
        scene, seed, lidar=lidar, radio=Radio(duration=seconds), sequence=False
    ).survey


@pytest.fixture
def clock() -> SteppedClock:
    """Its `step` is what the emulator calls after each round."""
    return SteppedClock(20.0)


@pytest.fixture
def make_bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    with ExitStack() as stack:

        def make(survey: Survey, speed: float = 20.0, faults: Faults | None = None) -> Bench:
            tripod: Tripod = play_survey(survey, 500.0)
            ports = tmp_path / "ports"
            ports.mkdir()
            spoilt = {} if faults is None else {ports / "sweep": faults}
            sweep, tag = SweepEmulator(tripod), Dwm1001Emulator(tripod)
            bench = Bench(sweep, tag, ports, SteppedClock(speed), spoilt)
            stack.enter_context(
                plugged_in(
                    {ports / "sweep": bench.sweep, ports / "tag": bench.tag},
                    clock=bench.clock,
                    after_round=bench.clock.step,
                    faults=spoilt,
                )
            )
            return bench

        yield make


@pytest.fixture(scope="session")
def flat() -> Survey:
    """Ten stations of three seconds."""
    return short_survey("flat", 3, 3.0)


@pytest.fixture(scope="session")
def paper_office() -> Survey:
    """The paper's eighteen stations, four seconds each."""
    return short_survey("paper-office", 1, 4.0)
