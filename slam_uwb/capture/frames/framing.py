"""Frames of one length in a stream that starts anywhere and is damaged now and then.

No device here has a header that cannot occur inside its data. A frame counts where its own test (header and
checksum) passes; where it fails the search goes on one byte further, never a whole frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..samples import Carry, Tally, counted

Bytes: TypeAlias = NDArray[np.uint8]
SoundAt: TypeAlias = Callable[[Bytes], NDArray[np.bool_]]
"""(B,) bytes -> (B - length + 1,) whether a sound frame starts at each offset."""


@dataclass(frozen=True, slots=True)
class Framing:
    """How the frames of a protocol are found."""

    length: int
    """Bytes a frame."""
    sound_at: SoundAt
    confirm: int = 1
    """Frames that must follow each other before the first is believed: more where the test is weak."""
    compare: int = 2
    """Of overlapping candidates the one with more followers wins, counted up to this."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The sound frames of a chunk."""

    frames: Bytes
    """(F, length)."""
    breaks: NDArray[np.int64]
    """(K,) indices of frames before which something was dropped."""
    tally: Tally
    carry: Carry


def find_frames(framing: Framing, carry: Carry, data: bytes, *, last: bool = False) -> Found:
    """Cut a chunk into frames.

    The result does not depend on how a stream is cut into chunks: where a decision needs bytes that are
    still to come, it waits for them (`carry.rest`, some frames at most).

    Args:
        framing: of the protocol.
        carry: from the chunk before.
        data: any number of bytes.
        last: nothing follows: decide by what is there.
    """
    raw = carry.rest + data
    stream = np.frombuffer(raw, dtype=np.uint8)
    runs = _runs(framing, stream)
    # Once for the chunk: a stream of nothing but losses must not be searched anew after each.
    believable = np.flatnonzero(runs >= framing.confirm)
    stretches: list[tuple[int, int]] = []
    breaks: list[int] = []
    position, locked, count, garbage, losses = 0, carry.locked, 0, 0, 0
    while position + framing.length <= len(raw):
        if locked and (number := int(runs[position])):
            stretches.append((position, number))
            position, count = position + number * framing.length, count + number
            continue
        losses += locked
        start, locked = _next_start(framing, runs, believable, position, last=last)
        garbage, position = garbage + start - position, start
        if not locked:
            break
        breaks.append(count)
    if last:
        garbage, position = garbage + len(raw) - position, len(raw)
    return Found(
        _cut_out(stream, stretches, framing.length),
        np.array(breaks, dtype=np.int64),
        Tally(len(data), count, counted(bytes_outside_frames=garbage, lost_sync=losses)),
        Carry(raw[position:], locked, carry.previous),
    )


def _cut_out(stream: Bytes, stretches: list[tuple[int, int]], length: int) -> Bytes:
    """(F, length) frames of stretches, each with its start and its number of frames."""
    frames = [
        stream[start : start + number * length].reshape(number, length)
        for start, number in stretches
    ]
    return np.concatenate([np.empty((0, length), dtype=np.uint8), *frames])


def _runs(framing: Framing, stream: Bytes) -> NDArray[np.int64]:
    """(B,) number of sound frames that follow each other from each offset on."""
    length = framing.length
    rows = -(-len(stream) // length) + 1
    sound = np.zeros(rows * length, dtype=bool)
    if len(stream) >= length:
        sound[: len(stream) - length + 1] = framing.sound_at(stream)
    table = sound.reshape(rows, length)
    # Each column is one phase; the next row that is not sound ends the run.
    ends = np.where(table, rows, np.arange(rows)[:, None])
    nearest = np.minimum.accumulate(ends[::-1], axis=0)[::-1]
    runs: NDArray[np.int64] = (nearest - np.arange(rows)[:, None]).reshape(-1)[: len(stream)]
    return runs


def _next_start(
    framing: Framing,
    runs: NDArray[np.int64],
    believable: NDArray[np.int64],
    position: int,
    *,
    last: bool,
) -> tuple[int, bool]:
    """Where the next believable frame starts and True; or how far the search came, and False."""
    size, length = len(runs), framing.length
    wanted = max(framing.confirm, framing.compare)
    # From here on bytes still to come may make a run, or a longer one.
    undecided = size if last else max(size - length * (wanted + 1) + 2, 0)
    index = int(np.searchsorted(believable, position))
    if index == len(believable) or believable[index] >= undecided:
        return max(position, min(undecided, size)), False
    start = int(believable[index])
    rivals = np.minimum(runs[start : start + length], wanted)
    return start + int(rivals.argmax()), True
