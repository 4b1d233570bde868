"""What every instrument delivers, whatever its protocol: samples, readings, and a tally of what was dropped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, frozen_array


@dataclass(frozen=True, slots=True, eq=False)
class LidarSamples:
    """Samples of a scanner in the order measured, in its own frame."""

    bearings: FloatArray
    """(N,) rad in [0, 2 pi), counter-clockwise seen from above, 0 at the scanner's forward mark."""
    ranges: FloatArray
    """(N,) m; NaN is no return."""
    signals: FloatArray
    """(N,) strength in the device's own units; NaN where it gives none."""
    starts: NDArray[np.int64]
    """(R,) increasing: a revolution starts before the sample of this index (N: before the next chunk's)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "bearings", frozen_array(self.bearings, (None,), "bearings"))
        for name in ("ranges", "signals"):
            object.__setattr__(
                self, name, frozen_array(getattr(self, name), self.bearings.shape, name)
            )
        starts = np.asarray(self.starts, dtype=np.int64)
        starts.flags.writeable = False
        object.__setattr__(self, "starts", starts)

    def __len__(self) -> int:
        return len(self.bearings)


NO_SAMPLES = LidarSamples(np.empty(0), np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))


def lidar_samples(
    degrees: FloatArray,
    ranges: FloatArray,
    signals: FloatArray,
    starts: NDArray[np.int64],
    *,
    clockwise: bool = False,
) -> LidarSamples:
    """Samples from angles in degrees as the device counts them; any whole turns are taken off."""
    turned = np.mod(-degrees if clockwise else degrees, 360.0)
    # mod of a tiny negative number rounds up to 360 itself.
    return LidarSamples(np.deg2rad(np.where(turned >= 360.0, 0.0, turned)), ranges, signals, starts)


@dataclass(frozen=True, slots=True)
class RangeReading:
    """One measured distance, or the reason why there is none."""

    anchor: str
    """The radio's identifier as the device prints it."""
    distance: float
    """m, slant, as the device gave it (negative values are kept); NaN where it gave none."""
    rss_dbm: float = float("nan")
    quality: str = ""
    """The device's own word or number on this distance; the reason where `distance` is NaN."""
    other: str | None = None
    """The second anchor of a distance between two anchors; None where the tag measured."""


@dataclass(frozen=True, slots=True)
class RangeEpoch:
    """The distances that one line or message of a device reports together."""

    readings: tuple[RangeReading, ...]
    tag: str | None = None
    """The measuring tag, where the device names it."""
    sequence: int | None = None
    """The device's own count, where it has one."""

    def __len__(self) -> int:
        return len(self.readings)


Samples_co = TypeVar("Samples_co", LidarSamples, Sequence[RangeEpoch], covariant=True)


@dataclass(frozen=True, slots=True)
class Tally:
    """What was made of a stream of bytes. `a + b` is the tally of both."""

    received: int = 0
    """Bytes."""
    frames: int = 0
    """Frames or lines that passed every test."""
    dropped: Mapping[str, int] = field(default_factory=dict)
    """Bytes, frames or lines left out, by reason."""

    def __add__(self, other: Tally) -> Tally:
        reasons = sorted({*self.dropped, *other.dropped})
        dropped = {
            reason: self.dropped.get(reason, 0) + other.dropped.get(reason, 0) for reason in reasons
        }
        return Tally(self.received + other.received, self.frames + other.frames, dropped)


def counted(**reasons: int) -> dict[str, int]:
    """A `dropped` of those reasons that occurred, with spaces for underscores."""
    return {name.replace("_", " "): number for name, number in reasons.items() if number}


@dataclass(frozen=True, slots=True)
class Carry:
    """What a decoder hands from one chunk to the next; a fresh one starts a stream."""

    rest: bytes = b""
    """Bytes that were not judged yet; bounded by the longest frame or line."""
    locked: bool = False
    """True while frame follows frame. For lines: True while the rest of an overlong one is skipped."""
    previous: bytes = b""
    """The last sound frame, where the next one completes it."""


@dataclass(frozen=True, slots=True)
class Decoded(Generic[Samples_co]):
    """What a decoder made of one chunk."""

    samples: Samples_co
    tally: Tally
    carry: Carry
