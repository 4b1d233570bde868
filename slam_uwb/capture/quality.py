"""How good a recording is while it is made: running figures in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..model.geometry import FloatArray
from .samples import LidarSamples, RangeEpoch, Tally

_REVOLUTIONS = 20
"""Of the last ones are rate and points told."""
_READINGS = 600
"""Of the last ones of an anchor are median and spread told: a minute at 10 Hz."""
_MAX_ANCHORS = 500
"""A damaged stream makes up identifiers; more anchors than these are not told one by one."""


@dataclass(frozen=True, slots=True)
class ScanQuality:
    """Of a scanner so far."""

    samples: int
    returns: int
    """Samples with a range."""
    revolutions: int
    """Whole ones."""
    points: float
    """Samples a revolution, median of the last ones; NaN before the first whole one."""
    rotation_hz: float
    """Of the last revolutions; NaN before the first whole one."""
    uneven: int
    """Revolutions whose number of samples is over 10 % off the median."""
    tally: Tally


@dataclass(frozen=True, slots=True)
class AnchorQuality:
    """Of the ranges to one anchor so far."""

    anchor: str
    count: int
    failed: int
    """Exchanges that the device reports as failed."""
    median: float
    """m, of the last readings; NaN where there is none."""
    spread: float
    """m, 1.4826 times the median absolute deviation of the last readings."""


@dataclass(slots=True)
class ScanWatch:
    """Gathers a `ScanQuality`."""

    samples: int = 0
    returns: int = 0
    revolutions: int = 0
    uneven: int = 0
    tally: Tally = field(default_factory=Tally)
    _since_start: int | None = None
    _recent: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_REVOLUTIONS))
    """When a revolution ended and its samples."""
    _started: float = float("nan")

    def add(self, samples: LidarSamples, times: FloatArray, tally: Tally) -> None:
        """One chunk with the (N,) s when its samples were taken."""
        self.tally = self.tally + tally
        before = 0
        for start in samples.starts.tolist():
            self._close_revolution(start - before, times, start)
            before = start
        if self._since_start is not None:
            self._since_start += len(samples) - before
        self.samples += len(samples)
        self.returns += int(np.isfinite(samples.ranges).sum())

    @property
    def turning(self) -> bool:
        """Whether a revolution was seen to begin."""
        return self._since_start is not None

    def _close_revolution(self, more: int, times: FloatArray, start: int) -> None:
        now = float(times[min(start, len(times) - 1)]) if len(times) else self._started
        if self._since_start is None:
            self._started = now
        else:
            points = self._since_start + more
            median = self._median()
            self.uneven += bool(abs(points - median) > 0.1 * median)
            self.revolutions += 1
            self._recent.append((now, points))
        self._since_start = 0

    def _median(self) -> float:
        return float(np.median([p for _, p in self._recent])) if self._recent else float("nan")

    def now(self) -> ScanQuality:
        """The figures."""
        rotation = float("nan")
        if len(self._recent) > 1:
            span = self._recent[-1][0] - self._recent[0][0]
            rotation = (len(self._recent) - 1) / span if span > 0 else float("nan")
        return ScanQuality(
            self.samples,
            self.returns,
            self.revolutions,
            self._median(),
            rotation,
            self.uneven,
            self.tally,
        )


@dataclass(slots=True)
class _Link:
    count: int = 0
    failed: int = 0
    recent: deque[float] = field(default_factory=lambda: deque(maxlen=_READINGS))


@dataclass(slots=True)
class RangeWatch:
    """Gathers an `AnchorQuality` for each anchor."""

    epochs: int = 0
    tally: Tally = field(default_factory=Tally)
    _links: dict[str, _Link] = field(default_factory=dict)

    def add(self, epochs: Sequence[RangeEpoch], tally: Tally) -> None:
        """One chunk."""
        self.tally = self.tally + tally
        self.epochs += len(epochs)
        for epoch in epochs:
            for reading in epoch.readings:
                if reading.other is not None:
                    continue
                if reading.anchor not in self._links and len(self._links) >= _MAX_ANCHORS:
                    continue
                link = self._links.setdefault(reading.anchor, _Link())
                if np.isfinite(reading.distance):
                    link.count += 1
                    link.recent.append(reading.distance)
                else:
                    link.failed += 1

    def now(self) -> tuple[AnchorQuality, ...]:
        """The figures, by identifier."""
        return tuple(_quality(name, self._links[name]) for name in sorted(self._links))


def _quality(name: str, link: _Link) -> AnchorQuality:
    recent = np.array(link.recent)
    median = float(np.median(recent)) if len(recent) else float("nan")
    spread = 1.4826 * float(np.median(np.abs(recent - median))) if len(recent) else float("nan")
    return AnchorQuality(name, link.count, link.failed, median, spread)
