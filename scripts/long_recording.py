"""Does a long recording need more memory than a short one? Decoders, recording loop and files as in `record`.

    python scripts/long_recording.py --lidar sweep --minutes 60
    python scripts/long_recording.py --lidar rplidar-c1-dense --minutes 60

The bytes of an instrument at its full rate are handed to the recording loop as fast as it takes them;
its clock goes by what it was given. Only the serial port is left out.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmark_capture import LES, capsule_stream, node_stream, sweep_stream

from slam_uwb.capture import recorder
from slam_uwb.capture.clock import Clock
from slam_uwb.capture.ports import LIDARS, TAGS, Instrument
from slam_uwb.capture.ports.device import Device, nothing
from slam_uwb.capture.ports.pump import Chunk
from slam_uwb.io import recording_station, start_survey

CHUNK_S = 10.0
REPORT_HZ = 10
SCANNERS: dict[str, tuple[Callable[[np.random.Generator], bytes], float]] = {
    # What makes the bytes, and how many s of the device at its full rate they are.
    "sweep": (sweep_stream, 60.0),
    "rplidar-a1": (node_stream, 30.0),
    "rplidar-c1-dense": (capsule_stream, 24.0),
}


class FedClock(Clock):
    """Shows the time of the chunk that was fetched last."""

    __slots__ = ("moment",)

    def __init__(self) -> None:
        super().__init__(1.0)
        object.__setattr__(self, "moment", 0.0)

    def now(self) -> float:
        """S of the recording."""
        return float(self.moment)

    def go_to(self, moment: float) -> None:
        """Let it be `moment`."""
        object.__setattr__(self, "moment", moment)


@dataclass(frozen=True)
class Source:
    """Stands where a port stands: what one instrument sends, over and over; no chunk is longer than that."""

    name: str
    clock: FedClock
    data: bytes = field(repr=False)
    seconds: float

    def between(self, begin: float, end: float) -> bytes:
        """The bytes of that time."""
        first, last = (int(t / self.seconds * len(self.data)) for t in (begin, end))
        rounds, start = divmod(first, len(self.data))
        return (self.data * 2)[start : last - rounds * len(self.data)]


class Feed:
    """Stands where the reading thread stands: hands on a chunk of each source in turn."""

    def __init__(
        self, sources: list[Any], clock: FedClock, each_minute: Callable[[], None]
    ) -> None:
        self.sources, self.clock, self.each_minute = sources, clock, each_minute
        self.arrivals = self
        self.waiting: list[Chunk] = []

    def empty(self) -> bool:
        """As of the queue of a `Pump`."""
        return not self.waiting

    def nothing_waits(self, _port: object) -> bool:
        """As of a `Pump`."""
        return self.empty()

    def get(self, timeout: float) -> Chunk:  # noqa: ARG002
        """The next chunk; there always is one."""
        if not self.waiting:
            begin = self.clock.now()
            end = begin + CHUNK_S
            if end % 60.0 < CHUNK_S:
                self.each_minute()
            self.clock.go_to(end)
            self.waiting = [Chunk(s, end, s.between(begin, end)) for s in self.sources]
        return self.waiting.pop(0)


def record_long(
    folder: Path, lidar: str, minutes: int, measure: Callable[[], int]
) -> tuple[list[int], recorder.StationReport]:
    """Record into a new survey; what `measure` gave at the end of each minute, and how it ended."""
    clock, measured = FedClock(), list[int]()
    make, seconds = SCANNERS[lidar]
    scan = Source("scanner", clock, make(np.random.default_rng(0)), seconds)
    report = Source("tag", clock, LES * REPORT_HZ * 60, 60.0)
    instruments: list[Instrument[Any]] = [
        Instrument(_unled(LIDARS[lidar]), scan, {}),  # type: ignore[arg-type]
        Instrument(_unled(TAGS["dwm1001"]), report, {}),  # type: ignore[arg-type]
    ]

    @contextmanager
    def fed(ports: list[Any]) -> Iterator[Feed]:
        yield Feed(ports, clock, lambda: measured.append(measure()))

    start_survey(
        folder,
        time_zero=datetime(2026, 1, 1, tzinfo=UTC),
        lidar={"model": lidar, "angle_direction": "ccw", "max_range_m": 40.0},
        tag={"height_m": 1.4},
    )
    with (
        mock.patch.object(recorder, "pumping", fed),
        recording_station(folder, "s01", epoch=0.0, keep_raw=True) as recording,
    ):
        ended = recorder.record_station(instruments, 60.0 * minutes, recording, clock=clock)
        recording.finish(complete=ended.problem is None, log={})
    return measured, ended


def _unled(device: Device[Any]) -> Device[Any]:
    """The device without its handshakes."""
    return replace(device, begin=nothing, end=nothing)


def resident_bytes() -> int:
    """Memory of this process that is in use now (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def main() -> None:
    """Print the memory every six minutes, and what was written."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lidar", choices=SCANNERS, default="sweep")
    parser.add_argument("--minutes", type=int, default=60)
    arguments = parser.parse_args()
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "survey"
        measured, ended = record_long(folder, arguments.lidar, arguments.minutes, resident_bytes)
        written = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    for minute, size in enumerate(measured, 1):
        if minute % 6 == 0:
            print(f"minute {minute:3d}: {size / 1e6:.1f} MB")
    samples = 0 if ended.live.scan is None else ended.live.scan.samples
    print(f"{samples:,} samples, {written / 1e6:.0f} MB written, {ended.problem or 'no problem'}")
    print(f"{time.process_time() - begun:.1f} s of processor")


if __name__ == "__main__":
    main()
