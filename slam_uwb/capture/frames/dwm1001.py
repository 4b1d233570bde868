r"""Qorvo (Decawave) DWM1001 with PANS firmware: the lines of its shell reports `les` and `lec`.

    022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082 est[6.97,5.17,-1.77,53]
    DIST,2,AN0,2F2F,3.05,2.68,0.00,2.20,AN1,2ED0,3.02,0.00,0.00,2.23,POS,1.76,1.59,0.51,40

Both grammars were tested on recorded lines. Reports get spliced when bytes are lost: only a line that fits
from end to end, with every anchor once, is believed.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..samples import Carry, Decoded, RangeEpoch, RangeReading
from .lines import decode_lines

_NUMBER = r"-?\d{1,6}\.\d{2}"
_PLACE = rf"{_NUMBER},{_NUMBER},{_NUMBER}"
_LES_READING = re.compile(rf"([0-9A-F]{{4}})\[{_PLACE}\]=({_NUMBER}) ", re.ASCII)
_LES_LINE = re.compile(
    rf"(?:[0-9A-F]{{4}}\[{_PLACE}\]={_NUMBER} ){{0,16}}"
    rf"le_us=\d{{1,9}}(?: est\[{_PLACE},(\d{{1,3}})\])?",
    re.ASCII,
)
_LEC_READING = re.compile(rf",AN(\d{{1,2}}),([0-9A-F]{{4}}),{_PLACE},({_NUMBER})", re.ASCII)
_LEC_LINE = re.compile(
    rf"DIST,(\d{{1,2}})((?:,AN\d{{1,2}},[0-9A-F]{{4}},{_PLACE},{_NUMBER}){{0,16}})"
    rf"(?:,POS,{_PLACE},\d{{1,3}})?",
    re.ASCII,
)
_REPORT = re.compile(r"le_us=|DIST,|[0-9A-Fa-f]{4}\[")
_PROMPT = "dwm> "


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of the shell; echoes, prompts and other answers are passed over without being counted."""
    return decode_lines(data, carry, parse_report, _REPORT, last=last)


def parse_report(line: str) -> RangeEpoch | None:
    """A line of `les` or `lec`; None where it is neither or not whole."""
    line = line.removeprefix(_PROMPT)
    if _LES_LINE.fullmatch(line):
        return _epoch(_LES_READING.findall(line))
    lec = _LEC_LINE.fullmatch(line)
    if lec is None:
        return None
    found = _LEC_READING.findall(lec[2])
    # Fields that are all there, but not as many or in the order announced, are two reports.
    if [int(number) for number, _, _ in found] != list(range(int(lec[1]))):
        return None
    return _epoch([(anchor, distance) for _, anchor, distance in found])


_INSIDE = re.compile(r"DIST,.*|[0-9A-F]{4}\[.*")


def find_report(line: str) -> RangeEpoch | None:
    """The report inside a line of a log, behind a time or within quotes; None where there is no whole one."""
    inside = _INSIDE.search(line)
    return None if inside is None else parse_report(inside[0].rstrip(' "}\r'))


def _epoch(found: Sequence[tuple[str, str]]) -> RangeEpoch | None:
    if len({anchor for anchor, _ in found}) < len(found):
        return None
    return RangeEpoch(tuple(RangeReading(anchor, float(metres)) for anchor, metres in found))


def encode(epoch: RangeEpoch) -> bytes:
    """The line of `les` for an epoch, as a tag without a position fix prints it (2 decimals)."""
    readings = "".join(
        f"{item.anchor}[0.00,0.00,0.00]={item.distance + 0.0:.2f} " for item in epoch.readings
    )
    return f"{readings}le_us=3000\r\n".encode()
