"""A serial port, opened for one instrument: pyserial's errors become `CaptureError`s that name port and remedy."""

from __future__ import annotations

import errno
import select
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

from ...model.errors import CaptureError, MissingLibraryError
from ..clock import REAL_TIME, Clock
from ..signals import strike_now

if TYPE_CHECKING:
    import serial

_LATE_S = 0.05
"""Of the host; silence is believed after that."""
_SENT_S = 1.0
"""Of the host; commands are a few bytes."""
_POLL_S = 0.02
"""Of the host; longest single wait for bytes, so that scaled clocks are kept."""


@dataclass(frozen=True, slots=True)
class Port:
    """An open port. Times are those of `clock`."""

    name: str
    line: serial.Serial
    clock: Clock

    def fileno(self) -> int:
        """For `select`."""
        with self._told():
            return int(self.line.fileno())

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        with self._told():
            self.line.write(data)
            # Not `flush`: a device that takes nothing would hold the program there for ever.
            end = time.monotonic() + _SENT_S
            while self.line.out_waiting and time.monotonic() < end:
                time.sleep(0.001)

    def has_waiting(self) -> bool:
        """Whether bytes have arrived that nobody read yet."""
        with self._told():
            return bool(select.select([self.line.fileno()], [], [], 0.0)[0])

    def read_available(self, limit: int | None = None) -> bytes:
        """What has arrived, at most `limit` bytes, without waiting; b"" where nothing has."""
        if not self.has_waiting():
            return b""
        with self._told():
            # At least one: a port that hung up is readable but has nothing, and must not be taken for a quiet one.
            number = max(1, self.line.in_waiting)
            return bytes(self.line.read(number if limit is None else min(number, limit)))

    def read_until(
        self, enough: Callable[[bytes], bool], timeout: float, what: str = "an answer"
    ) -> bytes:
        """Bytes up to the moment when they are `enough`; CaptureError where they never are."""
        data, deadline = b"", self.clock.now() + self.clock.patience(timeout)
        while not enough(data):
            # Late is judged before the read: what came while the host was busy is not late.
            late = self.clock.now() > deadline
            more = self._wait()
            data += more
            if late and not more:
                got = f"got {data[:40]!r}" if data else "nothing came"
                raise CaptureError(self.name, f"waited {timeout:g} s for {what}, {got}")
        return data

    def read_exactly(self, count: int, timeout: float, what: str) -> bytes:
        """`count` bytes and not one more; CaptureError where they do not come."""
        data, deadline = b"", self.clock.now() + self.clock.patience(timeout)
        while len(data) < count:
            late = self.clock.now() > deadline
            more = self._wait(count - len(data))
            data += more
            if late and not more:
                raise CaptureError(self.name, f"waited {timeout:g} s for {what}, got {data!r}")
        return data

    def drain(self, quiet: float, limit: float) -> bytes:
        """Read until nothing comes for `quiet` s, at most for `limit` s."""
        data = b""
        # A busy host may be late by some hundredths of a second, whatever its clock says.
        quiet = max(quiet, _LATE_S * self.clock.speed)
        end = self.clock.now() + max(limit, 2.0 * quiet)
        silent_since = self.clock.now()
        while self.clock.now() < end and self.clock.now() - silent_since < quiet:
            more = self._wait()
            if more:
                data = (data + more)[-65536:]
                silent_since = self.clock.now()
        return data

    def discard_input(self) -> None:
        """Forget what has arrived."""
        with self._told():
            self.line.reset_input_buffer()

    def set_dtr(self, asserted: bool) -> None:
        """Set the DTR line; a port that has none (a pseudo-terminal) is left as it is."""
        with self._told(), suppress_missing_lines():
            self.line.dtr = asserted

    def keep_dtr_after_close(self) -> None:
        """Closing usually drops DTR, which starts the motor of some scanners again."""
        with self._told(), suppress(termios.error):
            attributes = termios.tcgetattr(self.line.fileno())
            attributes[2] &= ~termios.HUPCL
            termios.tcsetattr(self.line.fileno(), termios.TCSANOW, attributes)

    def close(self) -> None:
        """Close; never raises."""
        with suppress(Exception):
            self.line.close()

    def _wait(self, limit: int | None = None) -> bytes:
        """What comes within a moment. A signal that was held strikes here: nothing is half-done."""
        strike_now()
        with self._told():
            select.select([self.line.fileno()], [], [], _POLL_S / self.clock.speed)
        return self.read_available(limit)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError, TypeError) as error:
            # pyserial's SerialException is an OSError; a descriptor closed under it is the other two.
            raise CaptureError(
                self.name, f"the instrument is gone (unplugged?): {_reason(error)}"
            ) from error


@contextmanager
def suppress_missing_lines() -> Iterator[None]:
    """Pass over the errors of ports without modem lines."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOTTY, errno.EINVAL):
            raise


def open_port(name: str, baud: int, *, dtr: bool | None = None, clock: Clock = REAL_TIME) -> Port:
    """Open a serial port, 8N1 without flow control, for this program alone.

    Args:
        name: e.g. /dev/ttyUSB0.
        baud: bits a second.
        dtr: how the DTR line stands from the first moment on; None leaves it to the system.
        clock: of all waits.

    Raises:
        CaptureError: there is no such port, it is in use or not permitted.
        MissingLibraryError: pyserial is not installed.
    """
    serial = import_serial()
    line = serial.Serial(timeout=0.0, write_timeout=2.0, exclusive=True)
    line.port, line.baudrate = name, baud
    if dtr is not None:
        line.dtr = dtr
    try:
        line.open()
    except (OSError, ValueError) as error:
        raise CaptureError(name, _why_not_open(error)) from error
    return Port(name, line, clock)


def import_serial() -> ModuleType:
    """The module `serial` of pyserial; MissingLibraryError where it is not installed."""
    try:
        import serial
    except ImportError:
        raise MissingLibraryError(
            'recording needs pyserial: pip install "slam-uwb[capture]"'
        ) from None
    return serial


def _reason(error: BaseException) -> str:
    return str(error).strip() or type(error).__name__


def _why_not_open(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return "no such port; `slam-uwb ports` lists what is plugged in"
    if number == errno.EACCES:
        return (
            "not permitted: on Linux add yourself to the group dialout (or uucp) and log in again"
        )
    if number in (errno.EBUSY, errno.EWOULDBLOCK, errno.EAGAIN):
        return "in use by another program"
    return f"cannot be opened: {_reason(error)}"
