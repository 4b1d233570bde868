"""Scanse Sweep: seven-byte data blocks (serial protocol specification of the sweep-sdk).

No raw recording of this stream was found: the decoder was tested against the specification, the vendor's
source and constructed bytes only. What marks a missing return comes from exported point files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..samples import Carry, Decoded, LidarSamples, Tally, counted, lidar_samples
from .framing import Bytes, Framing, find_frames

BLOCK = 7
_MAX_AZIMUTH = 360 * 16
_NO_RETURN_CM = 1
"""What the device gives where nothing came back (half a million exported points; never stated by the vendor)."""


def _sound_at(stream: Bytes) -> NDArray[np.bool_]:
    places = len(stream) - BLOCK + 1
    sums = np.concatenate([[0], np.cumsum(stream, dtype=np.int64)])
    # The checksum is modulo 255, not 256.
    checked = (sums[6 : 6 + places] - sums[:places]) % 255 == stream[6:]
    azimuth = stream[1 : 1 + places] + 256 * stream[2 : 2 + places].astype(np.int64)
    sound: NDArray[np.bool_] = checked & (azimuth <= _MAX_AZIMUTH)
    return sound


FRAMING = Framing(BLOCK, _sound_at, compare=4)


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[LidarSamples]:
    """One chunk of a stream between DS and DX.

    Blocks with an error bit are dropped, but a revolution that they start is kept. Azimuths of one sixteenth
    of a degree and distances of one centimetre are exact.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        last: nothing follows.
    """
    found = find_frames(FRAMING, carry, data, last=last)
    block = found.frames.astype(np.int64)
    starts = block[:, 0] & 1 == 1
    good = block[:, 0] & 0xFE == 0
    centimetres = (block[:, 3] + 256 * block[:, 4])[good]
    samples = lidar_samples(
        (block[:, 1] + 256 * block[:, 2])[good] / 16.0,
        np.where(centimetres > _NO_RETURN_CM, centimetres / 100.0, np.nan),
        block[good, 5].astype(np.float64),
        # Sync first, then drop: otherwise a bad sync block would merge two revolutions.
        np.concatenate([[0], np.cumsum(good)])[:-1][starts],
    )
    tally = found.tally + Tally(dropped=counted(device_error=int((~good).sum())))
    return Decoded(samples, tally, found.carry)


def encode(samples: LidarSamples) -> bytes:
    """The blocks that a Sweep would send; distances are rounded to 1 cm, azimuths to 1/16 degree."""
    block = np.zeros((len(samples), BLOCK), dtype=np.int64)
    block[samples.starts[samples.starts < len(samples)], 0] = 1
    azimuth = np.round(np.rad2deg(samples.bearings) * 16.0).astype(np.int64) % _MAX_AZIMUTH
    known = np.isfinite(samples.ranges)
    centimetres = np.where(known, np.round(np.nan_to_num(samples.ranges) * 100.0), _NO_RETURN_CM)
    distance = centimetres.astype(np.int64)
    block[:, 1], block[:, 2] = azimuth & 0xFF, azimuth >> 8
    block[:, 3], block[:, 4] = distance & 0xFF, distance >> 8
    block[:, 5] = np.nan_to_num(samples.signals, nan=0.0).astype(np.int64)
    block[:, 6] = block[:, :6].sum(axis=1) % 255
    return block.astype(np.uint8).tobytes()
