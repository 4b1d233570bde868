"""A DWM1001 tag: binary mode at first, a shell after two CR within a second, `les` on and off."""

from __future__ import annotations

from dataclasses import dataclass

from ..frames import dwm1001 as frames
from .tripod import Tripod

_BANNER = (
    b"\r\n\r\n DWM1001 TWR Real Time Location System\r\n\r\n Help      : ? or help\r\n\r\ndwm> "
)
_SI = (
    b"[000100.000 INF] sys: fw2 fw_ver=x01030001 cfg_ver=x00010700\r\n"
    b"[000100.010 INF] uwb0: panid=xD5A8 addr=xDECA9B3A1D10591A\r\n"
    b"[000100.020 INF] mode: tn (act,twr,np,le)\r\n"
    b"[000100.030 INF] cfg: sec=0 upd_rate_norm=1 upd_rate_stat=%d label=DW591A\r\n"
)
_BROKEN_TLV = b"\x40\x01\x01"
_ENTER_S = 1.0
_MAX_COMMAND = 128


@dataclass(slots=True)
class Dwm1001Emulator:
    """State of the device."""

    tripod: Tripod
    leads: bool = False
    """True where no scanner tells the tripod when a recording begins."""
    stationary_rate: int = 1
    """Of 100 ms, as `si` tells."""
    shell: bool = False
    reporting: bool = False
    _last_return: float = -10.0
    _last_command: bytes = b""
    _line: bytes = b""
    _begun: float = 0.0
    _sent: int = 0

    def power_on(self, now: float) -> None:
        """Back to binary mode."""
        self.shell, self.reporting, self._line = False, False, b""
        self._last_return, self._last_command, self._begun = -10.0, b"", now

    def receive(self, data: bytes, now: float) -> bytes:
        """Answer what the host sends, byte by byte as it does."""
        return b"".join(self._receive(bytes([byte]), now) for byte in data)

    def stream(self, now: float) -> bytes:
        """The reports due up to now."""
        station = self.tripod.station
        if not (self.shell and self.reporting and station.epochs):
            return b""
        if self.leads:
            self.tripod.played = now - self._begun
        due = int((now - self._begun) * len(station.epochs) / station.duration)
        epochs = [station.epochs[k % len(station.epochs)] for k in range(self._sent, due)]
        self._sent = max(due, self._sent)
        return b"".join(map(frames.encode, epochs))

    def _receive(self, byte: bytes, now: float) -> bytes:
        if not self.shell:
            return self._knock(byte, now)
        if byte != b"\r":
            self._line = (self._line + byte)[-_MAX_COMMAND:]
            return byte
        # A bare CR repeats the last command.
        command, self._line = self._line.strip() or self._last_command, b""
        self._last_command = command
        answer = self._obey(command, now)
        return b"\r\n" + answer + (b"" if command == b"quit" else b"dwm> ")

    def _knock(self, byte: bytes, now: float) -> bytes:
        if byte != b"\r":
            return _BROKEN_TLV
        twice, self._last_return = now - self._last_return < _ENTER_S, now
        if not twice:
            return b""
        self.shell = True
        return _BANNER

    def _obey(self, command: bytes, now: float) -> bytes:
        if command == b"les":
            self.reporting = not self.reporting
            if self.reporting:
                if self.leads:
                    self.tripod.begin()
                self._begun, self._sent = now, 0
            return b""
        if command == b"quit":
            self.shell = False
            return b""
        if command == b"si":
            return _SI % self.stationary_rate
        return b"" if not command else b"unknown command\r\n"
