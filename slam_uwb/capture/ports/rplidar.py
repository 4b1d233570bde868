"""Slamtec RPLIDAR A1, A2, A3, C1 and S1: identity, health, motor and scan modes (vendor's protocol and driver).

Tested against emulated devices only.
"""

from __future__ import annotations

from enum import Enum
from functools import partial

from ...model.errors import CaptureError
from ..frames import rplidar as frames
from ..samples import LidarSamples
from .device import Decode, Device, Identity
from .port import Port
from .rplidar_requests import ask, expect, find_mode, request

_STOP, _RESET, _INFO, _HEALTH = b"\xa5\x25", b"\xa5\x40", b"\xa5\x50", b"\xa5\x52"
_SCAN = b"\xa5\x20"
_EXPRESS_SCAN, _PWM_MOTOR, _RPM_MOTOR = 0x82, 0xF0, 0xA8
_INFO_ANSWER = bytes.fromhex("a55a1400000004")
_HEALTH_ANSWER = bytes.fromhex("a55a0300000006")
_SCAN_ANSWER = bytes.fromhex("a55a0500004081")
_EXPRESS_ANSWER = bytes.fromhex("a55a5400004082")
_DENSE_ANSWER = bytes.fromhex("a55a5400004085")
_DENSE = 0x85
_PWM = 660
"""The vendor's default of the motor's pulse width, 0 to 1023."""
_RPM = 600
"""The vendor's default of the turns a minute of scanners that take them."""
_BROKEN = 2
_USB = ((0x10C4, 0xEA60),)


class Motor(Enum):
    """What turns it on and off."""

    DTR = "dtr"
    """The line, asserted is off (A1)."""
    PWM = "pwm"
    """A pulse width (A2, A3)."""
    RPM = "rpm"
    """Turns a minute (S series); STOP is all that the vendor's driver sends to end it."""


class Stream(Enum):
    """Which answers are asked for."""

    NODES = "nodes"
    EXPRESS = "express"
    DENSE = "dense"


_DECODE: dict[Stream, Decode[LidarSamples]] = {
    Stream.NODES: frames.decode_standard,
    Stream.EXPRESS: frames.decode_express,
    Stream.DENSE: frames.decode_dense,
}


def _prepare(port: Port, motor: Motor, stream: Stream) -> Identity:
    _stop(port)
    info = ask(port, _INFO, _INFO_ANSWER, 20)
    if _status(port) == _BROKEN:
        # A protection stop is left by a reset only; the device boots for a while.
        port.write(_RESET)
        port.clock.sleep(2.0)
        _stop(port)
        if _status(port) == _BROKEN:
            raise CaptureError(
                port.name, "the scanner reports a hardware failure, after a reset too"
            )
    identity = {
        "model": f"0x{info[0]:02x}",
        "firmware": f"{info[2]}.{info[1]}",
        "hardware": str(info[3]),
        "serial": info[4:20].hex(),
    }
    if stream is Stream.DENSE:
        mode = find_mode(port, _DENSE)
        identity |= {
            "scan mode": f"{mode.number} {mode.name}",
            "sample period": f"{mode.sample_us:g} us",
            "reach": f"{mode.reach_m:g} m",
        }
    _turn(port, motor, on=True)
    return identity


def _begin(port: Port, stream: Stream) -> None:
    if stream is Stream.NODES:
        question, answer = _SCAN, _SCAN_ANSWER
    elif stream is Stream.EXPRESS:
        question, answer = request(_EXPRESS_SCAN, bytes(5)), _EXPRESS_ANSWER
    else:
        mode = find_mode(port, _DENSE).number
        question, answer = request(_EXPRESS_SCAN, bytes([mode, 0, 0, 0, 0])), _DENSE_ANSWER
    port.discard_input()
    port.write(question)
    expect(port, answer)


def _stop(port: Port) -> None:
    """STOP has no answer; what was under way is forgotten."""
    port.write(_STOP)
    port.clock.sleep(0.1)
    port.drain(quiet=0.05, limit=1.0)


def _rest(port: Port, motor: Motor) -> None:
    _stop(port)
    _turn(port, motor, on=False)


def _turn(port: Port, motor: Motor, *, on: bool) -> None:
    if motor is Motor.PWM:
        port.write(request(_PWM_MOTOR, (_PWM if on else 0).to_bytes(2, "little")))
    elif motor is Motor.RPM and on:
        port.write(request(_RPM_MOTOR, _RPM.to_bytes(2, "little")))
    port.set_dtr(not on)
    if not on:
        port.keep_dtr_after_close()


def _status(port: Port) -> int:
    return ask(port, _HEALTH, _HEALTH_ANSWER, 3)[0]


def _device(
    name: str, title: str, baud: int, sample_hz: float, reach: float, stream: Stream, motor: Motor
) -> Device[LidarSamples]:
    return Device(
        name=name,
        title=title,
        baud=baud,
        decode=_DECODE[stream],
        prepare=partial(_prepare, motor=motor, stream=stream),
        begin=partial(_begin, stream=stream),
        end=_stop,
        rest=partial(_rest, motor=motor),
        # From the first moment: an asserted DTR stops the motor of the A1.
        dtr=False,
        usb=_USB,
        first_s=5.0,
        sample_hz=sample_hz,
        max_range_m=reach,
        tested="recorded bytes" if stream is Stream.NODES else "constructed bytes",
    )


RPLIDARS = (
    _device("rplidar-a1", "RPLIDAR A1", 115200, 2000, 12.0, Stream.NODES, Motor.DTR),
    _device("rplidar-a2", "RPLIDAR A2", 115200, 2000, 12.0, Stream.NODES, Motor.PWM),
    _device("rplidar-a2-express", "RPLIDAR A2", 115200, 4000, 12.0, Stream.EXPRESS, Motor.PWM),
    _device("rplidar-a3", "RPLIDAR A3", 256000, 4000, 16.0, Stream.NODES, Motor.PWM),
    _device("rplidar-c1", "RPLIDAR C1", 460800, 5000, 12.0, Stream.NODES, Motor.DTR),
    _device("rplidar-c1-dense", "RPLIDAR C1", 460800, 5000, 12.0, Stream.DENSE, Motor.DTR),
    _device("rplidar-s1", "RPLIDAR S1", 256000, 9200, 40.0, Stream.DENSE, Motor.RPM),
)
