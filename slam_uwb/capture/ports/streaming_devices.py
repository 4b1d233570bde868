"""Instruments that talk by themselves once they have power, or need a line or two to begin.

All were tested on the bytes of the protocol notes only, their handshakes over pseudo-terminals against devices
that say what the notes say, none on the instrument.
"""

from __future__ import annotations

from ...model.errors import CaptureError
from ..frames import dwm1001_tlv, dwm3001, ld06, mauwb, trek1000
from ..samples import Carry
from .device import Device, Identity
from .port import Port

_RUN = 5
"""Sound frames within a second tell a one-way scanner (protocol notes, 12)."""


def _recognise_ld06(port: Port) -> Identity:
    """It takes no commands: a run of sound checksums is all the identity there is."""
    deadline = port.clock.now() + port.clock.patience(5.0)
    carry, run = Carry(), 0
    while run < _RUN:
        if port.clock.now() > deadline:
            raise CaptureError(port.name, "no frames of an LD06: wrong port, or not turning")
        found = ld06.decode(port.drain(quiet=0.02, limit=0.1), carry)
        carry, run = found.carry, run + found.tally.frames
    return {"model": "LD06 or kin"}


def _listen(port: Port) -> Identity:
    port.discard_input()
    return {}


def _enter_binary(port: Port) -> Identity:
    """In the shell `quit` leads back; in binary mode it is answered as a broken request."""
    port.write(b"quit\r")
    port.drain(quiet=0.5, limit=2.0)
    port.write(dwm1001_tlv.REQUEST)
    answer = port.drain(quiet=0.3, limit=1.0)
    if b"\x40\x01" not in answer:
        raise CaptureError(port.name, f"no answer in binary mode, got {answer[:20]!r}")
    return {"mode": "binary"}


def _prepare_dwm3001(port: Port) -> Identity:
    _stop_dwm3001(port)
    port.write(b"STAT\r\n")
    answer = port.drain(quiet=0.3, limit=2.0).decode("ascii", "replace")
    if "Info" not in answer and "ok" not in answer:
        raise CaptureError(port.name, f"STAT answered with {answer[:60]!r}; is it a DWM3001CDK?")
    return {"status": " ".join(answer.split())[:200]}


def _begin_dwm3001(port: Port) -> None:
    port.discard_input()
    # Controller of up to four responders with the addresses 1 to 4, five blocks a second.
    port.write(b"INITF -MULTI -BLOCK=200 -ADDR=0 -PADDR=[1,2,3,4]\r\n")


def _stop_dwm3001(port: Port) -> None:
    """Notifications that wait in its queue come before the `ok`."""
    port.write(b"STOP\r\n")
    port.drain(quiet=0.5, limit=3.0)


def _begin_mauwb(port: Port) -> None:
    port.discard_input()
    port.write(b"AT+SETRPT=1\r\n")


def _stop_mauwb(port: Port) -> None:
    port.write(b"AT+SETRPT=0\r\n")
    port.drain(quiet=0.2, limit=1.0)


LD06 = Device(
    name="ld06",
    title="LDROBOT LD06/LD19",
    baud=230400,
    decode=ld06.decode,
    prepare=_recognise_ld06,
    usb=((0x10C4, 0xEA60),),
    first_s=5.0,
    sample_hz=4500.0,
    rotation_hz=10.0,
    max_range_m=12.0,
    tested="recorded bytes",
)
DWM1001_TLV = Device(
    name="dwm1001-tlv",
    title="Qorvo DWM1001 (binary)",
    baud=115200,
    decode=dwm1001_tlv.decode,
    prepare=_enter_binary,
    poll=(dwm1001_tlv.REQUEST, 0.1),
    usb=((0x1366, 0x0105), (0x1366, 0x1015)),
    first_s=25.0,
    silence_s=2.0,
)
DWM3001 = Device(
    name="dwm3001",
    title="Qorvo DWM3001CDK",
    baud=115200,
    decode=dwm3001.decode,
    prepare=_prepare_dwm3001,
    begin=_begin_dwm3001,
    end=_stop_dwm3001,
    rest=_stop_dwm3001,
    silence_s=2.0,
    tested="published lines",
)
TREK1000 = Device(
    name="trek1000",
    title="Decawave TREK1000/EVK1000",
    baud=115200,
    decode=trek1000.decode,
    prepare=_listen,
    usb=((0x0483, 0x5740),),
    silence_s=2.0,
    tested="recorded lines",
)
MAUWB = Device(
    name="mauwb",
    title="Makerfabs MaUWB",
    baud=115200,
    decode=mauwb.decode,
    prepare=_listen,
    begin=_begin_mauwb,
    end=_stop_mauwb,
    rest=_stop_mauwb,
    silence_s=2.0,
    tested="published lines",
)
