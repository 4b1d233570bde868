"""Qorvo DWM1001 (PANS) in its binary mode: the answer to dwm_loc_get (`0C 00`).

The layout is that of the vendor's host code; tested on constructed bytes only. The successor firmware (PANS PRO,
LEAPS) answers in another layout, which is not read.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from ..samples import Carry, Decoded, RangeEpoch, RangeReading, Tally, counted

REQUEST = b"\x0c\x00"
"""dwm_loc_get."""
_OK = b"\x40\x01\x00"
_POSITION = b"\x41\x0d"
_PREFIX = len(_OK) + 15
_KINDS = {0x49: struct.Struct("<HIB13x"), 0x48: struct.Struct("<QIB")}
"""What a tag lists (address, mm, quality, and the anchor's own place) and what an anchor lists."""


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of answers. There is no checksum: header, types and lengths must agree, anchors be unique.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        last: nothing follows.
    """
    stream = carry.rest + data
    epochs: list[RangeEpoch] = []
    position = garbage = errors = 0
    while True:
        start = stream.find(b"\x40\x01", position)
        if start < 0:
            # A first byte of the next answer may already be there.
            start = len(stream) - (stream.endswith(b"\x40") and not last)
            garbage, position = garbage + max(start - position, 0), max(start, position)
            break
        garbage, position = garbage + start - position, start
        length = _length(stream, start)
        if length is None and not last:
            break
        epoch = _epoch(stream[start : start + length]) if length else None
        if epoch is not None and length:
            epochs.append(epoch)
            position += length
            continue
        # Refusals (busy, unknown) are answers too, but carry nothing.
        refused = stream[start + 2 : start + 3] not in (b"", b"\x00")
        errors += refused
        step = 3 if refused else 1
        garbage, position = garbage + (0 if refused else 1), position + step
    tally = Tally(len(data), len(epochs), counted(bytes_outside_frames=garbage, refusals=errors))
    return Decoded(tuple(epochs), tally, Carry(stream[position:]))


def _length(stream: bytes, start: int) -> int | None:
    """Bytes of the answer that starts here; 0 where none does, None where more is needed to tell."""
    head = stream[start : start + 5]
    if not (_OK + _POSITION).startswith(head):
        return 0
    announced = stream[start + _PREFIX : start + _PREFIX + 2]
    if len(announced) < 2:
        return None
    length = _PREFIX + 2 + announced[1]
    if announced[0] not in _KINDS:
        return 0
    return length if len(stream) - start >= length else None


def _epoch(answer: bytes) -> RangeEpoch | None:
    kind, size, number = answer[_PREFIX], answer[_PREFIX + 1], answer[_PREFIX + 2 : _PREFIX + 3]
    row = _KINDS[kind]
    if not number or size != 1 + number[0] * row.size:
        return None
    found = list(row.iter_unpack(answer[_PREFIX + 3 :]))
    if len({address for address, *_ in found}) < len(found):
        return None
    # Addresses print as the shell does: four hexadecimal digits of the last two bytes.
    return RangeEpoch(
        tuple(
            RangeReading(f"{address & 0xFFFF:04X}", millimetres / 1000.0, quality=str(quality))
            for address, millimetres, quality in found
        )
    )
