"""A Slamtec RPLIDAR C1: answers requests and streams dense capsules of the station where the tripod stands."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import reduce
from operator import xor

from ..frames import rplidar as frames
from .tripod import Tripod

SAMPLE_HZ = 5000.0
_SAMPLES_A_CAPSULE = 40
_MODEL = 0x41
_MODES = (("Standard", 0x81), ("DenseBoost", 0x85))
"""Name and type of answer, by number."""
_REACH_M = 12
_MAX_REQUEST = 64


@dataclass(slots=True)
class RplidarEmulator:
    """State of the device; `power_on` is what plugging it in does."""

    tripod: Tripod
    streaming: bool = False
    _begun: float = 0.0
    _sent: int = 0
    _input: bytes = b""
    _capsules: bytes = field(default=b"", repr=False)

    def power_on(self, now: float) -> None:
        """Forget everything."""
        self.streaming, self._input, self._begun = False, b"", now

    def receive(self, data: bytes, now: float) -> bytes:
        """Answer what the host sends; what is no request is passed over byte by byte."""
        answer = b""
        self._input = (self._input + data)[-_MAX_REQUEST:]
        while len(self._input) >= 2:
            length = self._length()
            if length > len(self._input):
                break
            if length:
                answer += self._answer(self._input[1], self._input[3 : length - 1], now)
            self._input = self._input[length or 1 :]
        return answer

    def stream(self, now: float) -> bytes:
        """The capsules due up to now."""
        total = len(self._capsules) // frames.CAPSULE
        if not self.streaming or not total:
            return b""
        due = int((now - self._begun) * SAMPLE_HZ / _SAMPLES_A_CAPSULE)
        self.tripod.played = now - self._begun
        data = bytearray()
        while self._sent < due:
            first = self._sent % total
            number = min(due - self._sent, total - first)
            data += self._capsules[first * frames.CAPSULE : (first + number) * frames.CAPSULE]
            self._sent += number
        return bytes(data)

    def _length(self) -> int:
        """Of the request that the input begins with; 0 where it begins with none."""
        if self._input[0] != 0xA5:
            return 0
        if not self._input[1] & 0x80:
            return 2
        length = 4 + (self._input[2] if len(self._input) > 2 else 0)
        whole = len(self._input) >= length
        return 0 if whole and reduce(xor, self._input[:length]) else length

    def _answer(self, command: int, payload: bytes, now: float) -> bytes:
        if command in (0x25, 0x40):
            self.streaming = False
        if command == 0x50:
            return _described(0x04, bytes([_MODEL, 2, 1, 18]) + bytes(range(16)))
        if command == 0x52:
            return _described(0x06, bytes(3))
        if command == 0x84 and len(payload) >= 4:
            return _configuration(payload)
        if command == 0x82 and len(payload) == 5 and payload[0] < len(_MODES):
            return self._start(_MODES[payload[0]][1], now)
        return b""

    def _start(self, kind: int, now: float) -> bytes:
        if kind != 0x85:
            return b""
        self._capsules = frames.encode_dense(self.tripod.begin().scan)
        self.streaming, self._begun, self._sent = True, now, 0
        return b"\xa5\x5a" + struct.pack("<I", frames.CAPSULE | 1 << 30) + bytes([kind])


def _configuration(payload: bytes) -> bytes:
    (what,) = struct.unpack_from("<I", payload)
    number = int.from_bytes(payload[4:6], "little")
    if number >= len(_MODES):
        return b""
    name, kind = _MODES[number]
    values = {
        0x70: struct.pack("<H", len(_MODES)),
        0x71: struct.pack("<I", round(256 * 1e6 / SAMPLE_HZ)),
        0x74: struct.pack("<I", 256 * _REACH_M),
        0x75: bytes([kind]),
        0x7C: struct.pack("<H", len(_MODES) - 1),
        0x7F: name.encode() + b"\0",
    }
    return _described(0x20, payload[:4] + values[what]) if what in values else b""


def _described(kind: int, payload: bytes) -> bytes:
    return b"\xa5\x5a" + struct.pack("<I", len(payload)) + bytes([kind]) + payload
