"""Requests of a Slamtec RPLIDAR with their answers, and what it says of its scan modes (vendor's protocol)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import reduce

from ...model.errors import CaptureError
from .port import Port

ANSWER_S = 2.0
_CONFIGURATION, _ANSWER = 0x84, 0x20
_MODES, _SAMPLE_US, _REACH, _KIND, _NAME = 0x70, 0x71, 0x74, 0x75, 0x7F
_MAX_MODES = 16
_MAX_VALUE = 64
"""Bytes of one value; a longer one is no answer."""
_Q8 = 256.0


@dataclass(frozen=True, slots=True)
class ScanMode:
    """One way in which a scanner measures, as it describes it itself."""

    number: int
    name: str
    kind: int
    """Type of the answer: 0x81 nodes, 0x82 express, 0x84 ultra, 0x85 dense capsules."""
    sample_us: float
    reach_m: float


def request(command: int, payload: bytes) -> bytes:
    """A request with a payload: start, command, length, payload, and the xor of all that."""
    body = bytes([0xA5, command, len(payload)]) + payload
    return body + bytes([reduce(lambda a, b: a ^ b, body)])


def ask(port: Port, command: bytes, answer: bytes, length: int) -> bytes:
    """Send a request; the payload behind its answer's descriptor."""
    port.discard_input()
    port.write(command)
    expect(port, answer)
    return port.read_exactly(length, ANSWER_S, "the rest of an answer")


def expect(port: Port, answer: bytes) -> None:
    """Read a descriptor; CaptureError where it is another one."""
    got = port.read_exactly(len(answer), ANSWER_S, "an answer of the scanner")
    if got != answer:
        raise CaptureError(
            port.name, f"answered {got.hex(' ')} instead of {answer.hex(' ')}: wrong model or baud?"
        )


def find_mode(port: Port, kind: int) -> ScanMode:
    """The scan mode whose answers are of a kind; of several the last, which is the vendor's densest.

    Raises:
        CaptureError: it has none (the message names those that it has), or knows no modes at all.
    """
    (number,) = struct.unpack("<H", _value(port, _MODES, None, 2))
    modes = [_mode(port, k) for k in range(min(number, _MAX_MODES))]
    found = [mode for mode in modes if mode.kind == kind]
    if not found:
        has = ", ".join(f"{mode.name} (0x{mode.kind:02x})" for mode in modes) or "none"
        raise CaptureError(
            port.name, f"has no scan mode that answers by 0x{kind:02x}; its modes: {has}"
        )
    return found[-1]


def _mode(port: Port, number: int) -> ScanMode:
    (sample,) = struct.unpack("<I", _value(port, _SAMPLE_US, number, 4))
    (reach,) = struct.unpack("<I", _value(port, _REACH, number, 4))
    kind = _value(port, _KIND, number, 1)[0]
    name = _value(port, _NAME, number, None).split(b"\0")[0]
    return ScanMode(number, name.decode("ascii", "replace"), kind, sample / _Q8, reach / _Q8)


def _value(port: Port, what: int, mode: int | None, length: int | None) -> bytes:
    """The value of one entry of the configuration; of any length where None."""
    payload = struct.pack("<I", what) + (b"" if mode is None else struct.pack("<H", mode))
    port.discard_input()
    port.write(request(_CONFIGURATION, payload))
    head = port.read_exactly(7, ANSWER_S, "its scan modes (none before firmware 1.24)")
    size = int.from_bytes(head[2:6], "little") & 0x3FFFFFFF
    if head[:2] != b"\xa5\x5a" or head[6] != _ANSWER or not 4 < size <= 4 + _MAX_VALUE:
        raise CaptureError(port.name, f"answered {head.hex(' ')} when asked for its scan modes")
    answer = port.read_exactly(size, ANSWER_S, "the rest of an answer")
    value = answer[4:]
    if answer[:4] != payload[:4] or (length is not None and len(value) < length):
        raise CaptureError(port.name, f"answered {answer.hex(' ')} when asked for entry 0x{what:x}")
    return value if length is None else value[:length]
