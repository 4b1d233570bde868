"""Decawave TREK1000, EVK1000 and clones (ULM1, ULA1): lines of hexadecimal fields, tested on recorded lines.

mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..samples import Carry, Decoded, RangeEpoch, RangeReading
from .lines import decode_lines

_LINE = re.compile(
    r"m([ca]) ([0-9a-f]{2})((?: [0-9a-f]{8}){1,8}) ([0-9a-f]{4}) ([0-9a-f]{2}) ([0-9a-f]{7,8}) "
    r"(?:[atl](\d{1,3}):a?(\d{1,3})|t(\d{1,3}):a(\d{1,3}))(?: \S{1,40}){0,2}",
    re.ASCII | re.IGNORECASE,
)
_REPORT = re.compile(r"\bm[ca] ", re.IGNORECASE)
_ANCHOR_PAIRS = {1: ("A0", "A1"), 2: ("A0", "A2"), 3: ("A1", "A2")}
"""Slots of an `ma` line."""


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of lines; raw (`mr`) and diagnostic (`me`) lines repeat others and are passed over."""
    return decode_lines(data, carry, parse_report, _REPORT, last=last)


def parse_report(line: str) -> RangeEpoch | None:
    """A line `mc` (tag to anchors A0, A1, ...) or `ma` (between anchors); None for any other."""
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    slots = [_millimetres(word) for word in match[3].split()]
    sequence = int(match[5], 16)
    if match[1].lower() == "a":
        # The mask of these lines does not say which slots are filled.
        pairs = [(pair, slots[k]) for k, pair in _ANCHOR_PAIRS.items() if k < len(slots)]
        readings = [
            RangeReading(a, mm / 1000.0, other=b) for (a, b), mm in pairs if mm not in (0, -1)
        ]
        return RangeEpoch(tuple(readings), None, sequence)
    mask = int(match[2], 16)
    # A slot that is masked out holds an old value.
    return RangeEpoch(
        tuple(RangeReading(f"A{k}", mm / 1000.0) for k, mm in enumerate(slots) if mask >> k & 1),
        match[7] or match[9],
        sequence,
    )


_LOGGED = re.compile(
    r"T:\d{9}:RR:(\d{1,3}):(\d{1,3}):(-?\d{1,7}):(-?\d{1,7}):(\d{1,6}):(\d{1,8})", re.ASCII
)
_INSIDE = re.compile(r"\bm[ca] .*|\bT:\d{9}:RR:.*", re.IGNORECASE)


def find_report(line: str) -> RangeEpoch | None:
    """The report inside a line of a log: the device's own, or the PC's (`T:time:RR:...`)."""
    inside = _INSIDE.search(line)
    if inside is None:
        return None
    text = inside[0].rstrip(' "}\r')
    logged = _LOGGED.fullmatch(text)
    if logged is None:
        return parse_report(text)
    reading = RangeReading(f"A{int(logged[2])}", int(logged[4]) / 1000.0)
    return RangeEpoch((reading,), logged[1], int(logged[5]))


def _millimetres(word: str) -> int:
    value = int(word, 16)
    return value - (1 << 32) if value >> 31 else value
