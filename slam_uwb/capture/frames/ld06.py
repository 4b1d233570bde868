"""LDROBOT LD06, LD19 and kin: 47-byte frames of twelve points. Tested on recorded frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..samples import Carry, Decoded, LidarSamples, lidar_samples
from .framing import Bytes, Framing, find_frames

FRAME = 47
_POINTS = 12


def _crc_table() -> NDArray[np.uint8]:
    """CRC-8 with the polynomial 0x4D, of each byte."""
    table = np.arange(256, dtype=np.int64)
    for _ in range(8):
        table = np.where(table & 0x80, table << 1 ^ 0x4D, table << 1) & 0xFF
    return table.astype(np.uint8)


_TABLE = _crc_table()


def checksum(frames: Bytes) -> NDArray[np.uint8]:
    """(F,) CRC-8 of the (F, N) bytes: polynomial 0x4D, from 0, not reflected."""
    crc = np.zeros(len(frames), dtype=np.uint8)
    for column in frames.T:
        crc = _TABLE[crc ^ column]
    return crc


def _frame_at(stream: Bytes) -> NDArray[np.bool_]:
    places = len(stream) - FRAME + 1
    sound = np.zeros(places, dtype=bool)
    heads = np.flatnonzero((stream[:places] == 0x54) & (stream[1 : places + 1] == 0x2C))
    frames = stream[heads[:, None] + np.arange(FRAME)]
    sound[heads] = checksum(frames[:, :-1]) == frames[:, -1]
    return sound


FRAMING = Framing(FRAME, _frame_at)


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[LidarSamples]:
    """One chunk. The vendor's filters are not applied: distance 0, whatever the intensity, is no return.

    A revolution starts where the angle falls back by more than half a turn: the protocol has no flag for it.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        last: nothing follows.
    """
    found = find_frames(FRAMING, carry, data, last=last)
    frame = found.frames.astype(np.int64)
    start = (frame[:, 4] + 256 * frame[:, 5]) / 100.0
    end = (frame[:, 42] + 256 * frame[:, 43]) / 100.0
    step = np.mod(end - start, 360.0) / (_POINTS - 1)
    degrees = np.mod(start[:, None] + step[:, None] * np.arange(_POINTS), 360.0).reshape(-1)
    points = frame[:, 6:42].reshape(-1, 3)
    millimetres = points[:, 0] + 256 * points[:, 1]
    before = float(carry.previous or b"nan")
    falls = np.diff(degrees, prepend=before) < -180.0
    samples = lidar_samples(
        degrees,
        np.where(millimetres > 0, millimetres / 1000.0, np.nan),
        points[:, 2].astype(np.float64),
        np.flatnonzero(falls),
        clockwise=True,
    )
    previous = repr(float(degrees[-1])).encode() if len(degrees) else carry.previous
    return Decoded(samples, found.tally, replace(found.carry, previous=previous))
