"""Scanse Sweep: commands, motor and readiness (serial protocol specification; libsweep's order of commands).

Tested against the emulator only. Answers are tried a second time where users reported late or garbled ones.
"""

from __future__ import annotations

from ...model.errors import CaptureError
from ..frames import sweep as frames
from .device import Device, Identity
from .port import Port

ROTATION_HZ = 2
SAMPLE_CODE = 1
"""500 samples a second, as in the paper."""
_RECEIPT_S = 1.0
_SETTLE_S = 12.0
"""Changing the motor's rate takes 6 to 9 s."""
_POLL_S = 0.5
_REASONS = {"11": "bad parameter", "12": "the motor is not stable", "13": "the motor stands still"}


def _prepare(port: Port) -> Identity:
    _stop_stream(port)
    version = _ask(port, "IV", 21)
    _set_motor(port, ROTATION_HZ)
    _await_motor(port)
    _order(port, f"LR{SAMPLE_CODE:02d}")
    return {
        "model": version[2:7],
        "protocol": ".".join(version[7:9]),
        "firmware": ".".join(version[9:11]),
        "hardware": version[11:12],
        # The specification's own example is one character too long: count from the right.
        "serial": version.rstrip()[-8:],
        "rotation_hz": _value(port, "MI"),
        "sample_rate_code": _value(port, "LI"),
    }


def _begin(port: Port) -> None:
    _await_motor(port)
    port.discard_input()
    port.write(b"DS\n")
    # Exactly the receipt: what follows it is the stream.
    receipt = port.read_exactly(6, _RECEIPT_S, "the receipt of DS")
    _check_receipt(port, "DS", receipt[2:5])


def _rest(port: Port) -> None:
    _stop_stream(port)
    try:
        _order(port, "MS00")
    except CaptureError:
        # A motor that spins up may refuse to be stopped until it is stable.
        _await_motor(port)
        _order(port, "MS00")


def _stop_stream(port: Port) -> None:
    """DX, forget what was under way, DX again, and only this receipt counts."""
    port.write(b"DX\n")
    port.clock.sleep(0.05)
    port.drain(quiet=0.04, limit=1.0)
    port.write(b"DX\n")
    answer = port.read_until(
        lambda data: _found(data, b"DX") is not None, _RECEIPT_S, "the receipt of DX"
    )
    receipt = _found(answer, b"DX") or b""
    _check_receipt(port, "DX", receipt[2:5])


def _found(data: bytes, command: bytes) -> bytes | None:
    """A plain receipt at the end of the bytes: what comes before may be the rest of the stream."""
    tail = data[-6:]
    return tail if len(tail) == 6 and tail.startswith(command) and tail.endswith(b"\n") else None


def _check_receipt(port: Port, command: str, status: bytes) -> None:
    """Three bytes: two digits and their check."""
    code = status[:2].decode("ascii", "replace")
    if len(status) < 3 or ((status[0] + status[1]) & 0x3F) + 0x30 != status[2]:
        raise CaptureError(port.name, f"garbled receipt of {command}: {status!r}; is it a Sweep?")
    if code not in ("00", "99"):
        raise CaptureError(port.name, f"{command} refused: {_REASONS.get(code, 'status ' + code)}")


def _ask(port: Port, command: str, length: int) -> str:
    """An information command; a line of `length` bytes comes back (asked twice where it does not)."""
    for attempt in (1, 2):
        port.discard_input()
        port.write(f"{command}\n".encode())
        try:
            answer = port.read_until(
                lambda data: data.endswith(b"\n"), _RECEIPT_S, f"the answer to {command}"
            )
        except CaptureError:
            if attempt == 2:
                raise
            continue
        text = answer.decode("ascii", "replace")
        if text.startswith(command) and len(text) >= length:
            return text
    raise CaptureError(port.name, f"{command} answered with {answer[:40]!r}; is it a Sweep?")


def _value(port: Port, command: str) -> str:
    return _ask(port, command, 5)[2:4]


def _order(port: Port, order: str) -> None:
    """A command with a parameter, which the receipt echoes."""
    port.discard_input()
    port.write(f"{order}\n".encode())
    answer = port.read_exactly(9, _RECEIPT_S, f"the receipt of {order}")
    if answer[:4] != order.encode():
        raise CaptureError(port.name, f"{order} answered with {answer!r}")
    _check_receipt(port, order, answer[5:8])


def _set_motor(port: Port, rotation_hz: int) -> None:
    if _value(port, "MI") != f"{rotation_hz:02d}":
        # Setting a motor that is still settling is refused.
        _await_motor(port)
        _order(port, f"MS{rotation_hz:02d}")


def _await_motor(port: Port) -> None:
    deadline = port.clock.now() + port.clock.patience(_SETTLE_S)
    while _value(port, "MZ") != "00":
        if port.clock.now() > deadline:
            raise CaptureError(port.name, f"the motor is not stable after {_SETTLE_S:g} s")
        port.clock.sleep(_POLL_S)


SWEEP = Device(
    name="sweep",
    title="Scanse Sweep",
    baud=115200,
    decode=frames.decode,
    prepare=_prepare,
    begin=_begin,
    end=_stop_stream,
    rest=_rest,
    usb=((0x0403, 0x6015),),
    first_s=2.0,
    silence_s=0.5,
    sample_hz=500.0,
    rotation_hz=float(ROTATION_HZ),
    max_range_m=40.0,
)
