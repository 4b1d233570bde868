"""Slamtec RPLIDAR: standard nodes (answer type 0x81), express and dense capsules (0x82, 0x85).

Standard nodes were tested on recorded bytes; capsules on the vendor's source and constructed bytes only. The
offset of an express sample is taken as unsigned, as the vendor's own driver does; the vendor's document calls
its top bit a sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray
from ..samples import Carry, Decoded, LidarSamples, Tally, counted, lidar_samples
from .framing import Bytes, Framing, find_frames

NODE = 5
CAPSULE = 84
_CABINS = 16
_DENSE = 40

Unpacked = tuple[FloatArray, FloatArray]
"""(P, K) degrees to subtract from the interpolated angle, (P, K) mm."""


def _node_at(stream: Bytes) -> NDArray[np.bool_]:
    first, second = stream[: len(stream) - NODE + 1], stream[1 : len(stream) - NODE + 2]
    angle = (second >> 1) + (stream[2 : len(stream) - 2].astype(np.int64) << 7)
    sound: NDArray[np.bool_] = (
        ((first ^ (first >> 1)) & 1 == 1) & (second & 1 == 1) & (angle <= 360 * 64)
    )
    return sound


# There is no checksum, two bits are all: a run must be long to be believed.
NODES = Framing(NODE, _node_at, confirm=8, compare=16)


def decode_standard(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[LidarSamples]:
    """One chunk of the answer to SCAN, its descriptor included or not; samples before the first start are stale.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        last: nothing follows.
    """
    found = find_frames(NODES, carry, data, last=last)
    node = found.frames.astype(np.int64)
    starts = np.flatnonzero(node[:, 0] & 1)
    begun = bool(carry.previous)
    stale = 0 if begun else int(starts[0]) if len(starts) else len(node)
    fresh = node[stale:]
    millimetres = (fresh[:, 3] + 256 * fresh[:, 4]) / 4.0
    samples = lidar_samples(
        ((fresh[:, 1] >> 1) + (fresh[:, 2] << 7)) / 64.0,
        np.where(millimetres > 0.0, millimetres / 1000.0, np.nan),
        (fresh[:, 0] >> 2).astype(np.float64),
        np.flatnonzero(fresh[:, 0] & 1),
        clockwise=True,
    )
    tally = found.tally + Tally(dropped=counted(samples_before_first_start=stale))
    following = replace(found.carry, previous=b"begun" if begun or len(starts) else b"")
    return Decoded(samples, tally, following)


def _capsule_at(stream: Bytes) -> NDArray[np.bool_]:
    places = len(stream) - CAPSULE + 1
    sound = np.zeros(places, dtype=bool)
    heads = np.flatnonzero((stream[:places] >> 4 == 0xA) & (stream[1 : places + 1] >> 4 == 0x5))
    # Running xor: that of any stretch is the xor of its two ends.
    running = np.concatenate([[np.uint8(0)], np.bitwise_xor.accumulate(stream)])
    check = (stream[heads] & 0xF) | (stream[heads + 1] & 0xF) << 4
    sound[heads] = (running[heads + CAPSULE] ^ running[heads + 2]) == check
    return sound


CAPSULES = Framing(CAPSULE, _capsule_at)


def decode_express(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[LidarSamples]:
    """One chunk of the answer to EXPRESS_SCAN, legacy (type 0x82): 32 samples a capsule, one capsule late.

    A capsule tells where it begins; where it ends, only the next one tells. So a capsule that is followed
    by a damaged one is lost with it.
    """
    return _decode_capsules(data, carry, _express, last=last)


def decode_dense(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[LidarSamples]:
    """As `decode_express`, for dense capsules (type 0x85): 40 samples a capsule without angle offsets."""
    return _decode_capsules(data, carry, _dense, last=last)


def _decode_capsules(
    data: bytes, carry: Carry, unpack: Callable[[Bytes], Unpacked], *, last: bool
) -> Decoded[LidarSamples]:
    found = find_frames(CAPSULES, carry, data, last=last)
    frames, breaks = found.frames, set(found.breaks.tolist())
    if carry.previous and len(frames):
        # The capsule that waited for its successor.
        frames = np.concatenate(
            [np.frombuffer(carry.previous[:CAPSULE], dtype=np.uint8)[None], frames]
        )
        breaks = {place + 1 for place in breaks}
    word = frames[:, 2].astype(np.int64) + 256 * frames[:, 3].astype(np.int64)
    begins, fresh = (word & 0x7FFF) / 64.0, word & 0x8000 != 0
    # A pair counts where the second really follows the first and is not the first after an internal reset.
    follows = ~fresh[1:]
    follows[[place - 1 for place in breaks if place >= 1]] = False
    spans = np.mod(np.diff(begins), 360.0)[follows]
    offsets, millimetres = unpack(frames[:-1][follows])
    shares = np.arange(offsets.shape[1]) / offsets.shape[1]
    raw = begins[:-1][follows, None] + spans[:, None] * shares
    turned = np.mod(raw.reshape(-1), 360.0)
    before = float(carry.previous[CAPSULE:] or b"nan")
    samples = lidar_samples(
        (raw - offsets).reshape(-1),
        np.where(millimetres > 0.0, millimetres / 1000.0, np.nan).reshape(-1),
        np.full(millimetres.size, np.nan),
        np.flatnonzero(np.diff(turned, prepend=before) < -180.0),
        clockwise=True,
    )
    lost = int((~follows).sum())
    tally = found.tally + Tally(dropped=counted(capsules_without_successor=lost))
    # Beside the capsule that waits for its successor, where the last revolution stands.
    angle = repr(float(turned[-1])).encode() if len(turned) else carry.previous[CAPSULE:]
    previous = frames[-1].tobytes() + angle if len(frames) else carry.previous
    return Decoded(samples, tally, replace(found.carry, previous=previous))


def _express(frames: Bytes) -> Unpacked:
    cabin = frames[:, 4:].reshape(len(frames), _CABINS, 5).astype(np.int64)
    words = np.stack(
        [cabin[..., 0] + 256 * cabin[..., 1], cabin[..., 2] + 256 * cabin[..., 3]], axis=-1
    )
    nibbles = np.stack([cabin[..., 4] & 0xF, cabin[..., 4] >> 4], axis=-1)
    offsets = (nibbles | (words & 3) << 4) / 8.0
    shape = (len(frames), 2 * _CABINS)
    return offsets.reshape(shape), (words >> 2).reshape(shape).astype(np.float64)


def _dense(frames: Bytes) -> Unpacked:
    low, high = frames[:, 4::2].astype(np.int64), frames[:, 5::2].astype(np.int64)
    return np.zeros((len(frames), _DENSE)), (low + 256 * high).astype(np.float64)


def encode_dense(samples: LidarSamples) -> bytes:
    """Dense capsules of a recording, the last samples that fill none left out; for emulators.

    The recording is played backwards: this device turns the other way. Its first capsule is marked as
    the first after a reset, so that repeating it makes no angle between its end and its start.
    """
    number = len(samples) // _DENSE
    used = slice(None, None, -1)
    degrees = np.mod(-np.rad2deg(samples.bearings[used]), 360.0)[: number * _DENSE : _DENSE]
    words = np.mod(np.rint(degrees * 64.0), 360 * 64).astype(np.uint16)
    words[:1] |= 0x8000
    metres = np.nan_to_num(samples.ranges[used][: number * _DENSE])
    millimetres = np.clip(np.rint(1000.0 * metres), 0, 0xFFFF).reshape(number, _DENSE)
    inner = np.column_stack([words, millimetres.astype(np.uint16)]).astype("<u2").view(np.uint8)
    check = np.bitwise_xor.reduce(inner, axis=1)
    return (
        np.column_stack([0xA0 | check & 0xF, 0x50 | check >> 4, inner]).astype(np.uint8).tobytes()
    )
