"""Slamtec RPLIDAR A1, A2, A3 and C1: identity, health, motor and scan modes (vendor's protocol and driver).

Tested against an emulated device only.
"""

from __future__ import annotations

from functools import partial, reduce

from ...model.errors import CaptureError
from ..frames import rplidar as frames
from ..samples import LidarSamples
from .device import Decode, Device, Identity
from .port import Port

_STOP, _RESET, _INFO, _HEALTH = b"\xa5\x25", b"\xa5\x40", b"\xa5\x50", b"\xa5\x52"
_SCAN = b"\xa5\x20"
_INFO_ANSWER = bytes.fromhex("a55a1400000004")
_HEALTH_ANSWER = bytes.fromhex("a55a0300000006")
_SCAN_ANSWER = bytes.fromhex("a55a0500004081")
_EXPRESS_ANSWER = bytes.fromhex("a55a5400004082")
_ANSWER_S = 2.0
_PWM = 660
"""The vendor's default of the motor's pulse width, 0 to 1023."""
_BROKEN = 2
_USB = ((0x10C4, 0xEA60),)


def request(command: int, payload: bytes) -> bytes:
    """A request with a payload: start, command, length, payload, and the xor of all that."""
    body = bytes([0xA5, command, len(payload)]) + payload
    return body + bytes([reduce(lambda a, b: a ^ b, body)])


def _prepare(port: Port, pwm: bool) -> Identity:
    _stop(port)
    info = _ask(port, _INFO, _INFO_ANSWER, 20)
    if _status(port) == _BROKEN:
        # A protection stop is left by a reset only; the device boots for a while.
        port.write(_RESET)
        port.clock.sleep(2.0)
        _stop(port)
        if _status(port) == _BROKEN:
            raise CaptureError(
                port.name, "the scanner reports a hardware failure, after a reset too"
            )
    _turn(port, pwm, on=True)
    return {
        "model": f"0x{info[0]:02x}",
        "firmware": f"{info[2]}.{info[1]}",
        "hardware": str(info[3]),
        "serial": info[4:20].hex(),
    }


def _begin(port: Port, express: bool) -> None:
    ask, answer = (request(0x82, bytes(5)), _EXPRESS_ANSWER) if express else (_SCAN, _SCAN_ANSWER)
    port.discard_input()
    port.write(ask)
    _expect(port, answer)


def _stop(port: Port) -> None:
    """STOP has no answer; what was under way is forgotten."""
    port.write(_STOP)
    port.clock.sleep(0.1)
    port.drain(quiet=0.05, limit=1.0)


def _rest(port: Port, pwm: bool) -> None:
    _stop(port)
    _turn(port, pwm, on=False)


def _turn(port: Port, pwm: bool, *, on: bool) -> None:
    """The motor: by pulse width where the adapter can, by DTR on the A1 (asserted is off)."""
    if pwm:
        port.write(request(0xF0, (_PWM if on else 0).to_bytes(2, "little")))
    port.set_dtr(not on)
    if not on:
        port.keep_dtr_after_close()


def _status(port: Port) -> int:
    return _ask(port, _HEALTH, _HEALTH_ANSWER, 3)[0]


def _ask(port: Port, command: bytes, answer: bytes, length: int) -> bytes:
    port.discard_input()
    port.write(command)
    _expect(port, answer)
    return port.read_exactly(length, _ANSWER_S, "the rest of an answer")


def _expect(port: Port, answer: bytes) -> None:
    got = port.read_exactly(len(answer), _ANSWER_S, "an answer of the scanner")
    if got != answer:
        raise CaptureError(
            port.name, f"answered {got.hex(' ')} instead of {answer.hex(' ')}: wrong model or baud?"
        )


def _device(
    name: str, title: str, baud: int, sample_hz: float, *, reach: float, express: bool, pwm: bool
) -> Device[LidarSamples]:
    decode: Decode[LidarSamples] = frames.decode_express if express else frames.decode_standard
    return Device(
        name=name,
        title=title,
        baud=baud,
        decode=decode,
        prepare=partial(_prepare, pwm=pwm),
        begin=partial(_begin, express=express),
        end=_stop,
        rest=partial(_rest, pwm=pwm),
        # From the first moment: an asserted DTR stops the motor of the A1.
        dtr=False,
        usb=_USB,
        first_s=5.0,
        sample_hz=sample_hz,
        max_range_m=reach,
        tested="constructed bytes" if express else "recorded bytes",
    )


RPLIDARS = (
    _device("rplidar-a1", "RPLIDAR A1", 115200, 2000, reach=12.0, express=False, pwm=False),
    _device("rplidar-a2", "RPLIDAR A2", 115200, 2000, reach=12.0, express=False, pwm=True),
    _device("rplidar-a2-express", "RPLIDAR A2", 115200, 4000, reach=12.0, express=True, pwm=True),
    _device("rplidar-a3", "RPLIDAR A3", 256000, 4000, reach=16.0, express=False, pwm=True),
    _device("rplidar-c1", "RPLIDAR C1", 460800, 5000, reach=12.0, express=False, pwm=False),
)
