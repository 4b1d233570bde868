"""Makerfabs MaUWB (DW3000 with STM32): the lines `AT+RANGE=...`, both forms; tested on published lines."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..samples import Carry, Decoded, RangeEpoch, RangeReading
from .lines import decode_lines

_NUMBERS = r"\((-?\d{1,6}(?:\.\d{1,2})?(?:,-?\d{1,6}(?:\.\d{1,2})?){7})\)"
_LINE = re.compile(
    rf"AT\+RANGE=tid:(\d{{1,3}}),mask:([0-9A-Fa-f]{{2}}),seq:(\d{{1,5}}),range:{_NUMBERS}"
    rf"(?:,rssi:{_NUMBERS})?(?:,ancid:{_NUMBERS})?",
    re.ASCII,
)
_REPORT = re.compile(r"AT\+RANGE")


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of lines."""
    return decode_lines(data, carry, parse_report, _REPORT, last=last)


def parse_report(line: str) -> RangeEpoch | None:
    """An `AT+RANGE` line; anchors are named A0 to A7 by slot, or by `ancid` where the firmware tells it."""
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    mask = int(match[2], 16)
    centimetres = [float(word) for word in match[4].split(",")]
    strengths = [float(word) for word in match[5].split(",")] if match[5] else [float("nan")] * 8
    anchors = (
        [word.partition(".")[0] for word in match[6].split(",")] if match[6] else list("01234567")
    )
    heard = [k for k in range(8) if mask >> k & 1 and not anchors[k].startswith("-")]
    if len({anchors[k] for k in heard}) < len(heard):
        return None
    readings = tuple(
        RangeReading(f"A{anchors[k]}", centimetres[k] / 100.0, strengths[k]) for k in heard
    )
    return RangeEpoch(readings, match[1], int(match[3]))
