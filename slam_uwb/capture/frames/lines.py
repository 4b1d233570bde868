"""Lines of text in a stream of bytes: bounded, whatever comes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..samples import Carry, Decoded, RangeEpoch, Tally, counted

Parse = Callable[[str], RangeEpoch | None]

MAX_LINE = 2_000
"""Bytes; the longest line of any device here has some hundreds."""
_ENDS = re.compile(rb"[\r\n]+")


@dataclass(frozen=True, slots=True)
class Lines:
    """The whole lines of a chunk."""

    texts: tuple[str, ...]
    """Without their ends, blank ones left out."""
    tally: Tally
    """`frames` counts nothing: what a line is worth, its decoder knows."""
    carry: Carry


def split_lines(carry: Carry, data: bytes, *, last: bool = False) -> Lines:
    r"""Cut a chunk at CR and LF; lines beyond `MAX_LINE` and bytes that are no ASCII text drop their line."""
    parts = _ENDS.split(carry.rest + data)
    rest = b"" if last else parts.pop()
    skipping, overlong, foreign = carry.locked, 0, 0
    texts: list[str] = []
    for part in parts:
        if skipping:
            skipping = False
        elif len(part) > MAX_LINE:
            overlong += 1
        elif not part.isascii() or b"\x00" in part:
            foreign += 1
        elif part.strip():
            texts.append(part.decode("ascii").strip())
    if skipping:
        rest = b""
    elif len(rest) > MAX_LINE:
        rest, skipping, overlong = b"", True, overlong + 1
    tally = Tally(len(data), 0, counted(overlong_lines=overlong, lines_of_other_bytes=foreign))
    return Lines(tuple(texts), tally, Carry(rest, skipping))


def decode_lines(
    data: bytes, carry: Carry, parse: Parse, report: re.Pattern[str], *, last: bool
) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of a device that reports an epoch a line.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        parse: a line -> its epoch, None where it is none.
        report: occurs in what is meant to be a report: such a line is counted where it cannot be read.
        last: nothing follows.
    """
    lines = split_lines(carry, data, last=last)
    parsed = [(line, parse(line)) for line in lines.texts]
    epochs = tuple(epoch for _, epoch in parsed if epoch is not None)
    garbled = sum(epoch is None and report.search(line) is not None for line, epoch in parsed)
    tally = lines.tally + Tally(0, len(epochs), counted(garbled_lines=garbled))
    return Decoded(epochs, tally, lines.carry)
