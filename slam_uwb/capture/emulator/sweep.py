"""A Scanse Sweep: answers its commands and streams data blocks of the station where the tripod stands."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..frames import sweep as frames
from .tripod import Tripod

SAMPLE_HZ = 500.0
_SETTLING_S = 6.0
_MAX_COMMAND = 64


@dataclass(slots=True)
class SweepEmulator:
    """State of the device; `power_on` is what plugging it in does."""

    tripod: Tripod
    settling: float = _SETTLING_S
    """S that the motor needs after a change."""
    motor: int = 5
    rate_code: int = 1
    powered: float = 0.0
    streaming: bool = False
    _ready_at: float = 0.0
    _begun: float = 0.0
    _sent: int = 0
    _input: bytes = b""
    _blocks: bytes = field(default=b"", repr=False)

    def power_on(self, now: float) -> None:
        """Forget everything but the motor's rate."""
        self.streaming, self._input, self._ready_at = False, b"", now + self.settling

    def receive(self, data: bytes, now: float) -> bytes:
        """Answer what the host sends."""
        answer = b""
        self._input += data
        while (end := self._input.find(b"\n")) >= 0:
            command, self._input = self._input[:end].strip(b"\r"), self._input[end + 1 :]
            answer += self._answer(command, now)
        self._input = self._input[-_MAX_COMMAND:]
        return answer

    def stream(self, now: float) -> bytes:
        """The blocks due up to now."""
        if not self.streaming or not self._blocks:
            return b""
        due = int((now - self._begun) * SAMPLE_HZ)
        self.tripod.played = now - self._begun
        total = len(self._blocks) // frames.BLOCK
        data = bytearray()
        while self._sent < due:
            first = self._sent % total
            number = min(due - self._sent, total - first)
            data += self._blocks[first * frames.BLOCK : (first + number) * frames.BLOCK]
            self._sent += number
        return bytes(data)

    def _answer(self, command: bytes, now: float) -> bytes:
        name, parameter = command[:2], command[2:4]
        settled = now >= self._ready_at
        if name == b"DS":
            return self._start(now, settled)
        if name == b"DX":
            self.streaming = False
            return _receipt(b"DX", b"00")
        if self.streaming:
            return b""
        if name == b"MZ":
            return b"MZ00\n" if settled else b"MZ01\n"
        if name == b"MI":
            return b"MI%02d\n" % self.motor
        if name == b"LI":
            return b"LI%02d\n" % self.rate_code
        if name == b"IV":
            return b"IVSWEEP1112100002152\n"
        if name == b"ID":
            return b"ID11520011%d%02d%04d\n" % (0, self.motor, 500)
        if name in (b"MS", b"LR") and parameter.isdigit():
            return self._set(name, parameter, now, settled)
        if name == b"RR":
            self.power_on(now)
        return b""

    def _start(self, now: float, settled: bool) -> bytes:
        if not settled or self.motor == 0:
            return _receipt(b"DS", b"12" if self.motor else b"13")
        self._blocks = frames.encode(self.tripod.begin().scan)
        self.streaming, self._begun, self._sent = True, now, 0
        return _receipt(b"DS", b"00")

    def _set(self, name: bytes, parameter: bytes, now: float, settled: bool) -> bytes:
        value, status = int(parameter), b"00"
        if value > (10 if name == b"MS" else 3) or (name == b"LR" and value == 0):
            status = b"11"
        elif not settled:
            status = b"12"
        elif name == b"MS":
            self.motor, self._ready_at = value, now + self.settling
        else:
            self.rate_code = value
        return name + parameter + b"\n" + _receipt(b"", status)


def _receipt(name: bytes, status: bytes) -> bytes:
    check = ((status[0] + status[1]) & 0x3F) + 0x30
    return name + status + bytes([check]) + b"\n"
