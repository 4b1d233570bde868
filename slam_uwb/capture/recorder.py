"""Record one station: both instruments at once, written as it arrives, judged while it runs."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..model.errors import CaptureError
from ..model.geometry import FloatArray
from .clock import REAL_TIME, Clock
from .plausibility import doubts_of_ranges, doubts_of_scan
from .ports.pump import Chunk, Pump, pumping
from .ports.session import Instrument, streaming
from .quality import AnchorQuality, RangeWatch, ScanQuality, ScanWatch
from .samples import Carry, LidarSamples, RangeEpoch
from .signals import strike_now

_TICK_S = 0.1
"""Of the host; how often the loop looks up where nothing arrives."""
_SPARE_TURNS = 2.5
"""Revolutions within which one must be seen to begin."""
_FLUSH_S = 1.0
"""What a crash may cost."""


class Sink(Protocol):
    """Where a recording goes; times in s since the recording began."""

    def add_scan(
        self, bearings: FloatArray, ranges: FloatArray, times: FloatArray, signals: FloatArray
    ) -> None:
        """(N,) samples: rad counter-clockwise, m (NaN: no return), s, device's units."""

    def add_range(
        self, anchor: str, distance: float, time: float, rss_dbm: float, quality: str
    ) -> None:
        """One distance from the tag, m."""

    def add_anchor_range(self, anchor_a: str, anchor_b: str, distance: float, time: float) -> None:
        """One distance between two anchors, m."""

    def add_raw(self, device: str, data: bytes) -> None:
        """Bytes as they came."""

    def flush(self) -> None:
        """Make durable what was added."""


@dataclass(frozen=True, slots=True)
class Live:
    """The recording at one moment."""

    elapsed: float
    """S since every instrument delivered; 0 before."""
    duration: float
    scan: ScanQuality | None
    """None without a scanner."""
    anchors: tuple[AnchorQuality, ...]
    silent: float
    """S since the tag's last report; NaN without a tag."""


@dataclass(frozen=True, slots=True)
class StationReport:
    """How a recording ended."""

    live: Live
    """At its end."""
    problem: CaptureError | None
    """What broke it off; None where it ran its time."""
    doubts: tuple[str, ...] = ()
    """What a look at the recording should be given to."""


@dataclass(slots=True)
class _Stream:
    """One instrument while it streams."""

    instrument: Instrument[Any]
    carry: Carry = field(default_factory=Carry)
    first: float | None = None
    heard: float = 0.0
    """When the last sound frame came (or the stream was started)."""
    polled: float = -np.inf
    sampled: float = -np.inf
    """Time of the last sample: times of a recording never go back."""


@dataclass(slots=True)
class _Recording:
    sink: Sink
    begun: float
    streams: dict[str, _Stream]
    scan: ScanWatch | None
    ranges: RangeWatch | None
    finish_at: float | None = None


def record_station(
    instruments: Sequence[Instrument[Any]],
    duration: float,
    sink: Sink,
    *,
    watch: Callable[[Live], None] = lambda _live: None,
    clock: Clock = REAL_TIME,
) -> StationReport:
    """Start the instruments, record for `duration` s from the moment on that all of them deliver, stop them.

    The scanner is started first. A silent or unplugged instrument ends the recording with a `problem`;
    what was recorded up to then is in the sink.

    Args:
        instruments: connected ones; at most one scanner and one tag.
        duration: s.
        sink: is flushed every second and at the end, but not closed.
        watch: is called some times a second.
        clock: that of the instruments' ports.
    """
    recording = _recording_of(instruments, sink, clock)
    problem: CaptureError | None = None
    try:
        with ExitStack() as stack:
            for instrument in sorted(instruments, key=_is_scanner, reverse=True):
                stack.enter_context(streaming(instrument))
                recording.streams[instrument.port.name].heard = clock.now()
            _run(recording, duration, watch, clock)
    except CaptureError as error:
        problem = error
    finally:
        sink.flush()
    live = _live(recording, duration, clock)
    return StationReport(live, problem, _doubts(recording, live))


def _recording_of(instruments: Sequence[Instrument[Any]], sink: Sink, clock: Clock) -> _Recording:
    """One that begins now and that nothing has arrived for."""
    return _Recording(
        sink,
        clock.now(),
        {instrument.port.name: _Stream(instrument) for instrument in instruments},
        ScanWatch() if any(map(_is_scanner, instruments)) else None,
        RangeWatch() if not all(map(_is_scanner, instruments)) else None,
    )


def _is_scanner(instrument: Instrument[Any]) -> bool:
    return instrument.device.sample_hz is not None


def _run(
    recording: _Recording, duration: float, watch: Callable[[Live], None], clock: Clock
) -> None:
    ports = [stream.instrument.port for stream in recording.streams.values()]
    flushed = clock.now()
    with pumping(ports) as pump:
        while recording.finish_at is None or clock.now() < recording.finish_at:
            strike_now()
            _take_next(recording, pump, _TICK_S / max(1.0, clock.speed))
            _poll(recording, clock)
            _see_who_delivers(recording, duration, pump, clock)
            if clock.now() - flushed >= _FLUSH_S:
                recording.sink.flush()
                flushed = clock.now()
            if pump.arrivals.empty():
                watch(_live(recording, duration, clock))
        # What came in time and was not fetched yet; a stream that goes on is not followed.
        latest = -np.inf
        while latest <= recording.finish_at and not all(map(pump.nothing_waits, ports)):
            latest = _take_next(recording, pump, _TICK_S)


def _take_next(recording: _Recording, pump: Pump, timeout: float) -> float:
    """Decode what arrives next; its time, or one long ago where nothing came within `timeout` s of the host."""
    try:
        arrival = pump.arrivals.get(timeout=timeout)
    except queue.Empty:
        return -np.inf
    if isinstance(arrival, CaptureError):
        raise arrival
    _take(recording, arrival)
    return arrival.time


def _poll(recording: _Recording, clock: Clock) -> None:
    """Ask those that speak only when asked."""
    for stream in recording.streams.values():
        poll, now = stream.instrument.device.poll, clock.now()
        if poll is not None and now - stream.polled >= poll[1]:
            stream.polled = now
            stream.instrument.port.write(poll[0])


def _take(recording: _Recording, chunk: Chunk) -> None:
    """Decode a chunk and hand its samples on."""
    stream = recording.streams[chunk.port.name]
    device = stream.instrument.device
    recording.sink.add_raw(device.name, chunk.data)
    decoded = device.decode(chunk.data, stream.carry)
    stream.carry = decoded.carry
    if decoded.tally.frames:
        stream.heard = chunk.time
        stream.first = chunk.time if stream.first is None else stream.first
    time = chunk.time - recording.begun
    if isinstance(decoded.samples, LidarSamples):
        times = _sample_times(stream, time, len(decoded.samples), device.sample_hz or 1.0)
        if recording.scan is not None:
            recording.scan.add(decoded.samples, times, decoded.tally)
        if len(decoded.samples):
            recording.sink.add_scan(
                decoded.samples.bearings, decoded.samples.ranges, times, decoded.samples.signals
            )
        return
    if recording.ranges is not None:
        recording.ranges.add(decoded.samples, decoded.tally)
    for epoch in decoded.samples:
        _hand_on(recording.sink, epoch, time)


def _hand_on(sink: Sink, epoch: RangeEpoch, time: float) -> None:
    for item in epoch.readings:
        if item.other is not None:
            sink.add_anchor_range(item.anchor, item.other, item.distance, time)
        else:
            sink.add_range(item.anchor, item.distance, time, item.rss_dbm, item.quality)


def _sample_times(stream: _Stream, arrived: float, number: int, rate: float) -> FloatArray:
    """(N,) s: spread back from the moment of reading at the nominal rate, never before what came earlier."""
    times = arrived - (number - 1 - np.arange(number)) / rate
    times = np.maximum(times, stream.sampled)
    if number:
        stream.sampled = float(times[-1])
    return times


def _see_who_delivers(recording: _Recording, duration: float, pump: Pump, clock: Clock) -> None:
    """Set the end of the recording once all deliver; CaptureError where one is silent too long."""
    streams = recording.streams.values()
    for stream in streams:
        device, silent = stream.instrument.device, clock.now() - stream.heard
        limit = device.first_s if stream.first is None else device.silence_s
        if silent > clock.patience(limit) and pump.nothing_waits(stream.instrument.port):
            since = "since it was started" if stream.first is None else "and then fell silent"
            raise CaptureError(
                stream.instrument.port.name,
                f"{device.title}: no sound frame for {silent:.1f} s {since} (limit {limit:g} s)",
            )
        _see_it_turn(recording, stream)
    if recording.finish_at is None and all(stream.first is not None for stream in streams):
        recording.finish_at = max(stream.first or 0.0 for stream in streams) + duration


def _see_it_turn(recording: _Recording, stream: _Stream) -> None:
    """CaptureError where a scanner delivers, but no revolution ever begins (Sweep firmware below 1.4)."""
    device, scan = stream.instrument.device, recording.scan
    if scan is None or scan.turning or not device.sample_hz or not device.rotation_hz:
        return
    if scan.samples > _SPARE_TURNS * device.sample_hz / device.rotation_hz:
        raise CaptureError(
            stream.instrument.port.name,
            f"{device.title}: no revolution begins in {scan.samples} samples: cut its power for a moment, "
            "update its firmware",
        )


def _live(recording: _Recording, duration: float, clock: Clock) -> Live:
    end = recording.finish_at
    elapsed = 0.0 if end is None else min(max(duration - (end - clock.now()), 0.0), duration)
    tags = [s for s in recording.streams.values() if not _is_scanner(s.instrument)]
    return Live(
        elapsed,
        duration,
        None if recording.scan is None else recording.scan.now(),
        () if recording.ranges is None else recording.ranges.now(),
        clock.now() - tags[0].heard if tags else float("nan"),
    )


def _doubts(recording: _Recording, live: Live) -> tuple[str, ...]:
    """Of both instruments."""
    found: list[str] = []
    for stream in recording.streams.values():
        if live.scan is not None and _is_scanner(stream.instrument):
            found += doubts_of_scan(live.scan, stream.instrument.device.rotation_hz)
    if recording.ranges is not None:
        found += doubts_of_ranges(recording.ranges)
    return tuple(found)
