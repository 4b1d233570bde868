"""Qorvo DWM3001CDK: JSON lines of the older command line, and SESSION_INFO_NTF of SDK 1.0.2 to 1.1.0.

Both dialects were tested on published lines. A notification with several responders runs over several lines.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..samples import Carry, Decoded, RangeEpoch, RangeReading, Tally, counted
from .lines import MAX_LINE, split_lines

_OPENING = "SESSION_INFO_NTF"
_NOTIFICATION = re.compile(
    r"SESSION_INFO_NTF: ?\{session_handle=\d{1,10}, ?sequence_number=\d{1,10}, ?block_index=(\d{1,10}), ?"
    r"n_measurements=(\d{1,3})((?:[ ;]*\[[^\[\]{}]*(?:\[(?:cm|dBm)\][^\[\]{}]*)*\])*)[ ;]*\}",
    re.ASCII,
)
_GROUP = re.compile(r"\[([^\[\]{}]*(?:\[(?:cm|dBm)\][^\[\]{}]*)*)\]", re.ASCII)
_FIELD = re.compile(r'([A-Za-z_]+)(?:\[\w+\])?="?([^",;]*)"?', re.ASCII)
_ADDRESS = re.compile(r"0x([0-9A-Fa-f]{1,16})", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,7}(?:\.\d{1,6})?", re.ASCII)


def decode(data: bytes, carry: Carry, *, last: bool = False) -> Decoded[Sequence[RangeEpoch]]:
    """One chunk of lines; whatever is no measurement (echoes, `ok`, service replies) is passed over.

    Args:
        data: any number of bytes.
        carry: from the chunk before; `Carry()` for the first.
        last: nothing follows.
    """
    lines = split_lines(carry, data, last=last)
    open_text = carry.previous.decode("ascii")
    epochs: list[RangeEpoch] = []
    garbled = 0
    for line in lines.texts:
        if line.startswith(_OPENING):
            garbled += bool(open_text)
            open_text = line
        elif open_text:
            open_text = f"{open_text} {line}"
        elif line.startswith('{"Block"'):
            epoch = parse_json(line)
            garbled += epoch is None
            epochs += [epoch] if epoch is not None else []
            continue
        if open_text and (open_text.endswith("}") or len(open_text) > MAX_LINE):
            epoch = parse_notification(open_text)
            garbled += epoch is None
            epochs += [epoch] if epoch is not None else []
            open_text = ""
    if last:
        garbled, open_text = garbled + bool(open_text), ""
    tally = lines.tally + Tally(0, len(epochs), counted(garbled_lines=garbled))
    return Decoded(tuple(epochs), tally, replace(lines.carry, previous=open_text.encode()))


def parse_json(line: str) -> RangeEpoch | None:
    """A line `{"Block":N, "results":[...]}`; None where it is damaged. Failures stay, with their reason."""
    try:
        block = json.loads(line, parse_constant=_refuse)
    except (ValueError, RecursionError):
        return None
    results = block.get("results") if isinstance(block, dict) else None
    if not isinstance(results, list) or not isinstance(block.get("Block"), int):
        return None
    readings = [_json_reading(row, block) for row in results]
    return _whole(readings, block["Block"])


def _json_reading(row: Any, block: dict[str, Any]) -> RangeReading | None:
    if not isinstance(row, dict):
        return None
    strength = str(block.get("RSSI_dBm", ""))
    return _reading(
        str(row.get("Addr", "")),
        "" if row.get("Status") == "Ok" else str(row.get("Status", "missing")),
        str(row.get("D_cm", "")),
        strength,
    )


def _refuse(constant: str) -> float:
    raise ValueError(constant)


def parse_notification(text: str) -> RangeEpoch | None:
    """A whole `SESSION_INFO_NTF: {...}`, its lines joined; None where it is damaged."""
    match = _NOTIFICATION.fullmatch(text)
    if match is None:
        return None
    groups = [dict(_FIELD.findall(group)) for group in _GROUP.findall(match[3])]
    if len(groups) != int(match[2]):
        return None
    readings = [
        _reading(
            group.get("mac_address", ""),
            "" if group.get("status") == "SUCCESS" else group.get("status", "missing"),
            group.get("distance", ""),
            group.get("RSSI", ""),
        )
        for group in groups
    ]
    return _whole(readings, int(match[1]))


def _reading(address: str, problem: str, centimetres: str, strength: str) -> RangeReading | None:
    """One measurement; a success needs a distance."""
    known = _ADDRESS.fullmatch(address)
    if known is None or len(problem) > 40:
        return None
    anchor = known[1].upper().rjust(4, "0")
    if problem:
        return RangeReading(anchor, float("nan"), quality=problem)
    if _NUMBER.fullmatch(centimetres.strip()) is None:
        return None
    rss = float(strength) if _NUMBER.fullmatch(strength.strip()) else float("nan")
    return RangeReading(anchor, float(centimetres) / 100.0, rss)


def _whole(readings: Sequence[RangeReading | None], sequence: int) -> RangeEpoch | None:
    """An epoch of which every reading could be read and every anchor is there once."""
    sound = tuple(item for item in readings if item is not None)
    if len(sound) < len(readings) or len({item.anchor for item in sound}) < len(sound):
        return None
    return RangeEpoch(sound, None, sequence)
