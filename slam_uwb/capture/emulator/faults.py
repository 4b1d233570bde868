"""What goes wrong between an instrument and the host."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Faults:
    """Damage to a stream. Times in s of streaming; shares are of the bytes."""

    noise: float = 0.0
    """Share of bytes with one bit turned over."""
    torn: float = 0.0
    """Share of bytes at which some bytes are lost."""
    inserted: float = 0.0
    """Share of bytes before which some foreign ones come."""
    stall_at: float | None = None
    """Nothing comes any more from here on, until the stream is started anew."""
    unplug_at: float | None = None
    """The cable is pulled, once."""
    replug_after: float = 1.0
    """S until it is plugged in again."""

    def spoil(self, data: bytes, rng: np.random.Generator) -> bytes:
        """The bytes as they arrive."""
        if not data or not (self.noise or self.torn or self.inserted):
            return data
        stream = np.frombuffer(data, dtype=np.uint8).copy()
        hit = rng.random(len(stream)) < self.noise
        stream[hit] ^= (1 << rng.integers(0, 8, len(stream)))[hit].astype(np.uint8)
        keep = np.ones(len(stream), dtype=bool)
        for start in np.flatnonzero(rng.random(len(stream)) < self.torn):
            keep[start : start + rng.integers(1, 9)] = False
        stream = stream[keep]
        places = np.flatnonzero(rng.random(len(stream)) < self.inserted)
        foreign = [rng.integers(0, 256, rng.integers(1, 9), dtype=np.uint8) for _ in places]
        parts: list[np.ndarray] = np.split(stream, places)
        woven = [parts[0]]
        for extra, part in zip(foreign, parts[1:], strict=True):
            woven += [extra, part]
        return bytes(np.concatenate(woven).tobytes())


NO_FAULTS = Faults()
