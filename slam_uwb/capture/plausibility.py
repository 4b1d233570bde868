"""Does a recording look as that of a tripod should? The limits are those of the protocol notes."""

from __future__ import annotations

from collections.abc import Iterator

from .quality import RangeWatch, ScanQuality

_RATE_SHARE = 0.1
"""The rotation may be so far off its nominal rate, and so many revolutions may be uneven."""
_DAMAGED_SHARE = 0.001
_GARBLED_SHARE = 0.01


def doubts_of_scan(scan: ScanQuality, nominal_hz: float | None) -> Iterator[str]:
    """What is odd of a scanner's recording; `nominal_hz` of its rotation, None where it has none."""
    if scan.returns == 0:
        yield "the scanner saw nothing: is it covered?"
    if nominal_hz and abs(scan.rotation_hz - nominal_hz) > _RATE_SHARE * nominal_hz:
        yield f"the scanner turns at {scan.rotation_hz:.2f} Hz instead of {nominal_hz:g} Hz"
    if scan.uneven > _RATE_SHARE * max(scan.revolutions, 1):
        yield f"{scan.uneven} of {scan.revolutions} revolutions have missing points"
    damaged = sum(scan.tally.dropped.values())
    if damaged > _DAMAGED_SHARE * max(scan.tally.received, 1):
        yield f"{damaged} of {scan.tally.received} bytes of the scanner were damaged"


def doubts_of_ranges(ranges: RangeWatch) -> Iterator[str]:
    """What is odd of a tag's recording."""
    garbled = ranges.tally.dropped.get("garbled lines", 0)
    if garbled > _GARBLED_SHARE * max(ranges.tally.frames, 1):
        yield f"{garbled} lines of the tag were garbled"
    if not any(anchor.count for anchor in ranges.now()):
        yield "no anchor was heard"
