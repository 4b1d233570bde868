"""Lines of text in a stream of bytes: bounded, whatever comes."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..samples import Carry, Tally, counted

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
