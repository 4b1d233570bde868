r"""Qorvo DWM1001 (PANS): from its binary mode into the shell, and the report `les` on and off.

The lines were tested on recorded ones, the way into the shell against the emulator only.
"""

from __future__ import annotations

import re
from contextlib import suppress

from ...model.errors import CaptureError
from ..frames import dwm1001 as frames
from .device import Device, Identity
from .port import Port

_PROMPT = b"dwm>"
_REPORT = re.compile(rb"le_us=|DIST,")
_AFTER_COMMAND_S = 0.5
"""Commands that follow each other faster get lost."""


def _prepare(port: Port) -> Identity:
    _enter_shell(port)
    port.write(b"si\r")
    answer = port.read_until(_is_answered, 3.0, "the answer to si").decode("ascii", "replace")
    found = {
        name: match[1]
        for name, pattern in {
            "firmware": r"fw_ver=(\S+)",
            "address": r"addr=(\S+)",
            "mode": r"mode: (\S+)",
            "update_rate": r"upd_rate_norm=(\d+)",
            "update_rate_stationary": r"upd_rate_stat=(\d+)",
            "label": r"label=(\S+)",
        }.items()
        if (match := re.search(pattern, answer))
    }
    if not found:
        raise CaptureError(port.name, f"`si` answered with {answer[:60]!r}; is it a DWM1001?")
    slow = found.get("update_rate_stationary")
    if slow is not None and slow != found.get("update_rate"):
        # A tripod stands still: the tag would fall to this rate.
        found["warning"] = (
            f"a tag at rest reports every {int(slow) / 10:g} s only: set its stationary update rate "
            "to the normal one"
        )
    return found


def _enter_shell(port: Port) -> None:
    """To the prompt, with no report running, from whatever state."""
    port.discard_input()
    answer = b""
    for _ in range(3):
        answer = b""
        port.write(b"\r")
        port.clock.sleep(0.1)
        port.write(b"\r")
        with suppress(CaptureError):
            answer = port.read_until(lambda data: _PROMPT in data or _reports(data), 2.0)
        answer += port.drain(quiet=_AFTER_COMMAND_S, limit=1.0)
        if _reports(answer):
            # In the shell a bare CR repeats the last command, and a report toggles.
            if not _reports(port.drain(quiet=0.5, limit=1.0)):
                return
            port.write(b"\r")
            answer = port.drain(quiet=0.5, limit=1.0)
        if _PROMPT in answer:
            return
    raise CaptureError(port.name, f"no prompt of the shell, got {answer[-60:]!r}; is it a DWM1001?")


def _is_answered(data: bytes) -> bool:
    """The prompt stands behind what `si` says of the configuration."""
    return b"cfg" in data and data.rstrip().endswith(_PROMPT)


def _reports(answer: bytes) -> bool:
    return _REPORT.search(answer) is not None


def _begin(port: Port) -> None:
    port.discard_input()
    port.write(b"les\r")


def _end(port: Port) -> None:
    # The report toggles, and a slow tag may be silent for longer than anybody listens: count on `_begin`.
    port.write(b"les\r")
    _stop_if_heard(port)


def _rest(port: Port) -> None:
    _stop_if_heard(port)
    port.write(b"quit\r")


def _stop_if_heard(port: Port) -> None:
    port.drain(quiet=0.3, limit=0.5)
    if _reports(port.drain(quiet=0.5, limit=0.5)):
        port.write(b"les\r")
        port.drain(quiet=0.3, limit=1.0)


DWM1001 = Device(
    name="dwm1001",
    title="Qorvo DWM1001 (shell)",
    baud=115200,
    decode=frames.decode,
    prepare=_prepare,
    begin=_begin,
    end=_end,
    rest=_rest,
    usb=((0x1366, 0x0105), (0x1366, 0x1015)),
    first_s=25.0,
    silence_s=2.0,
    tested="recorded lines",
)
