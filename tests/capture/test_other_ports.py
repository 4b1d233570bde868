"""Handshakes of the other instruments, against devices that say what the protocol notes say."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest

from slam_uwb.capture.emulator import RplidarEmulator, play_survey, plugged_in
from slam_uwb.capture.frames import ld06
from slam_uwb.capture.ports import LIDARS, TAGS, connected
from slam_uwb.capture.recorder import record_station
from slam_uwb.capture.signals import unhurried
from slam_uwb.model.errors import CaptureError


@dataclass
class Device:
    """Answers requests by a table and streams one frame over and over."""

    answers: dict[bytes, bytes]
    frame: bytes
    period: float
    starts: bytes | None
    stops: bytes | None
    heard: bytes = b""
    streaming: bool = False
    begun: float = 0.0
    sent: int = 0
    log: list[bytes] = field(default_factory=list)

    def power_on(self, now: float) -> None:
        self.streaming, self.begun = self.starts is None, now

    def receive(self, data: bytes, now: float) -> bytes:
        self.heard += data
        answer = b""
        while request := next((r for r in self.known() if self.heard.startswith(r)), None):
            self.heard = self.heard[len(request) :]
            self.log.append(request)
            answer += self.answers.get(request, b"")
            if request == self.starts:
                self.streaming, self.begun, self.sent = True, now, 0
            elif request == self.stops:
                self.streaming = False
        return answer

    def known(self) -> list[bytes]:
        return sorted({*self.answers, self.starts, self.stops} - {None}, key=len, reverse=True)

    def stream(self, now: float) -> bytes:
        if not self.streaming:
            return b""
        due = int((now - self.begun) / self.period)
        number, self.sent = due - self.sent, due
        return self.frame * number


class Sink:
    """Counts."""

    def __init__(self) -> None:
        self.samples, self.ranges, self.seen, self.scan = 0, [], set(), []

    def add_scan(self, bearings, ranges, times, signals):
        self.samples += len(bearings)
        self.scan.append(np.column_stack([bearings, ranges]))
        self.seen |= set(np.asarray(ranges)[np.isfinite(ranges)].tolist())

    def add_range(self, anchor, distance, time, rss_dbm, quality):
        self.ranges.append((anchor, distance))

    def add_anchor_range(self, *_):
        pass

    def add_raw(self, *_):
        pass

    def flush(self):
        pass


def record(device, emulated, path: Path, clock, seconds=2.0):
    sink = Sink()
    with plugged_in({path: emulated}, clock=clock, after_round=clock.step):
        try:
            with connected(device, str(path), clock) as instrument:
                report = record_station([instrument], seconds, sink, clock=clock)
                identity = dict(instrument.identity)
        finally:
            # What was sent last has no answer to wait for.
            time.sleep(0.05)
    if report.problem is not None:
        raise report.problem
    return sink, identity


INFO = bytes.fromhex("a55a1400000004 18 1d 01 07") + bytes(range(16))
GOOD_HEALTH, BAD_HEALTH = (bytes.fromhex(f"a55a0300000006 {s} 00 00") for s in ("00", "02"))
REVOLUTION = bytes.fromhex("3d01 00 a00f") + bytes.fromhex("3e 01 20 a00f") * 9


def rplidar(health=GOOD_HEALTH, scan=bytes.fromhex("a55a0500004081")):
    pwm = {bytes.fromhex(text): b"" for text in ("a5f0029402c1", "a5f002000057")}
    return Device(
        {b"\xa5\x50": INFO, b"\xa5\x52": health, b"\xa5\x20": scan, b"\xa5\x40": b"boot", **pwm},
        REVOLUTION,
        0.01,
        b"\xa5\x20",
        b"\xa5\x25",
    )


@pytest.mark.parametrize("name", ["rplidar-a1", "rplidar-a2", "rplidar-a3", "rplidar-c1"])
def test_rplidar(tmp_path, clock, name):
    device = rplidar()
    sink, identity = record(LIDARS[name], device, tmp_path / "port", clock)
    assert sink.samples > 1000
    assert (identity["model"], identity["firmware"]) == ("0x18", "1.29")
    assert not device.streaming
    # The motors of A2 and A3: on, then off at last.
    motor = [r.hex() for r in device.log if r[1:2] == b"\xf0"]
    by_pulses = name in ("rplidar-a2", "rplidar-a3")
    assert motor == (["a5f0029402c1", "a5f002000057"] if by_pulses else [])
    assert device.log[-1] == (bytes.fromhex("a5f002000057") if by_pulses else b"\xa5\x25")


EXPRESS = bytes.fromhex("a5 82 05 00 00 00 00 00 22")


def express_revolution():
    """Thirty capsules of 12 degrees; all cabins at 1000 mm, no offset (protocol notes, 2.5)."""
    capsules = b""
    for k in range(30):
        inner = (12 * k * 64).to_bytes(2, "little") + bytes.fromhex("a00f a00f 00") * 16
        check = reduce(xor, inner)
        capsules += bytes([0xA0 | check & 0xF, 0x50 | check >> 4]) + inner
    return capsules


def express_rplidar(answer=bytes.fromhex("a55a5400004082")):
    device = rplidar()
    del device.answers[b"\xa5\x20"]
    device.answers[EXPRESS] = answer
    device.frame, device.period, device.starts = express_revolution(), 960 / 4000, EXPRESS
    return device


def test_rplidar_express(tmp_path, clock):
    device = express_rplidar()
    sink, _ = record(LIDARS["rplidar-a2-express"], device, tmp_path / "port", clock)
    # 4000 samples a second for two seconds, all but the capsule that waits for its successor.
    assert 5000 < sink.samples < 10_000
    assert sink.seen == {1.0}
    assert not device.streaming
    assert device.log.count(EXPRESS) == 1
    assert device.log[-2:] == [b"\xa5\x25", bytes.fromhex("a5f002000057")]


def test_an_rplidar_that_answers_express_by_another_kind_of_capsules(tmp_path, clock):
    # A firmware that streams dense capsules would be decoded to wrong ranges with sound checksums.
    device = express_rplidar(bytes.fromhex("a55a5400004085"))
    with pytest.raises(CaptureError, match="00 40 85 instead of"):
        record(LIDARS["rplidar-a2-express"], device, tmp_path / "port", clock)
    assert device.log[-1] == bytes.fromhex("a5f002000057")


@pytest.mark.parametrize("name", ["rplidar-c1-dense", "rplidar-s1"])
def test_rplidar_dense(tmp_path, clock, flat, name):
    """What the emulated scanner saw arrives: angles to the 1/64 degree of the capsules, ranges to the mm."""
    emulated = RplidarEmulator(play_survey(flat, 500.0))
    played = emulated.tripod.stations[0].scan
    sink, identity = record(LIDARS[name], emulated, tmp_path / "port", clock)
    assert identity["scan mode"] == "1 DenseBoost"
    assert identity["sample period"] == "200 us"
    assert not emulated.streaming
    found = np.concatenate(sink.scan)
    # 5000 samples a second for two seconds.
    assert 6000 < len(found) < 12_000
    # The recording comes backwards; one that is repeated loses the capsule before its start each time.
    count = len(played) // 40 * 40 - 40
    expected = np.column_stack([played.bearings, played.ranges])[::-1][:count]
    turns = np.angle(np.exp(1j * (found[:count, 0] - expected[:, 0])))
    assert np.abs(turns).max() < np.deg2rad(1.0)
    assert np.degrees(np.sqrt(np.mean(turns**2))) < 0.3
    np.testing.assert_allclose(found[:count, 1], expected[:, 1], atol=5.1e-4, equal_nan=True)


def conf(what, value, mode=None):
    """A request for an entry of the configuration and its answer (protocol notes, 2.2)."""
    asked = bytes([what, 0, 0, 0]) + (b"" if mode is None else bytes([mode, 0]))
    question = bytes([0xA5, 0x84, len(asked)]) + asked
    answer = bytes.fromhex("a55a") + bytes([4 + len(value), 0, 0, 0, 0x20]) + asked[:4] + value
    return {question + bytes([reduce(xor, question)]): answer}


def modes(*kinds):
    entries = conf(0x70, bytes([len(kinds), 0]))
    for number, kind in enumerate(kinds):
        entries |= conf(0x71, (63 * 256).to_bytes(4, "little"), number)
        entries |= conf(0x74, (25 * 256).to_bytes(4, "little"), number)
        entries |= conf(0x75, bytes([kind]), number)
        entries |= conf(0x7F, b"Mode%d\0" % number, number)
    return entries


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        (modes(0x81, 0x84), r"no scan mode that answers by 0x85; its modes: Mode0 \(0x81\), Mode1"),
        ({}, "its scan modes .none before firmware 1.24."),
        (conf(0x70, b""), "when asked for its scan modes"),
        (conf(0x70, b"\x01\x00") | conf(0x71, b"\x00", 0), "when asked for entry 0x71"),
        (
            {next(iter(conf(0x70, b""))): b"\xa5\x5a\xff\xff\xff\x3f\x20"},
            "when asked for its scan modes",
        ),
    ],
)
def test_an_rplidar_without_dense_capsules(tmp_path, clock, entries, told):
    device = rplidar()
    device.answers |= entries
    with pytest.raises(CaptureError, match=told):
        record(LIDARS["rplidar-c1-dense"], device, tmp_path / "port", clock)
    assert not device.streaming


def test_an_s1_is_turned_by_turns_a_minute(tmp_path, clock):
    device = rplidar()
    turn, scan = bytes.fromhex("a5 a8 02 58 02 55"), bytes.fromhex("a5 82 05 01 00 00 00 00 23")
    device.answers |= modes(0x81, 0x85) | {turn: b"", scan: bytes.fromhex("a55a5400004085")}
    device.frame, device.period, device.starts = express_revolution(), 1200 / 9200, scan
    sink, _ = record(LIDARS["rplidar-s1"], device, tmp_path / "port", clock)
    assert sink.samples > 8000
    assert device.log.count(turn) == 1
    # Nothing after STOP, as the vendor's driver leaves it.
    assert device.log[-1] == b"\xa5\x25"


@pytest.mark.parametrize(
    ("device", "told"),
    [
        (rplidar(health=BAD_HEALTH), "hardware failure"),
        (rplidar(health=b""), "waited 2 s"),
    ],
)
def test_an_rplidar_that_is_not_well(tmp_path, clock, device, told):
    with (
        plugged_in({tmp_path / "port": device}, clock=clock, after_round=clock.step),
        pytest.raises(CaptureError, match=told),
        connected(LIDARS["rplidar-a1"], str(tmp_path / "port"), clock),
    ):
        pass


def test_ld06(tmp_path, clock):
    body = bytes.fromhex("542c6808") + (0).to_bytes(2, "little") + b"\xe8\x03\x64" * 12
    # Almost a turn a frame, so that each begins a revolution.
    body += (32999).to_bytes(2, "little") + b"\x00\x00"
    frame = body + ld06.checksum(np.frombuffer(body, dtype=np.uint8)[None]).tobytes()
    sink, _ = record(
        LIDARS["ld06"], Device({}, frame, 12 / 4500, None, None), tmp_path / "port", clock
    )
    assert sink.samples > 8000


def test_noise_is_no_ld06(tmp_path, clock):
    noise = Device({}, bytes(range(7)), 0.001, None, None)
    with (
        plugged_in({tmp_path / "port": noise}, clock=clock, after_round=clock.step),
        pytest.raises(CaptureError, match="no frames of an LD06"),
        connected(LIDARS["ld06"], str(tmp_path / "port"), clock),
    ):
        pass


TLV = bytes.fromhex(
    "40 01 00 41 0d ce 04 00 00 3e fe ff ff d4 03 00 00 4d 49 29 02 2e 02 70 0d 00 00 64 04 1f 00 00"
    "5e 1f 00 00 00 00 00 00 64 80 92 30 16 00 00 64 0e 1f 00 00 00 00 00 00 00 00 00 00 64"
)


def test_dwm1001_in_binary_mode_is_polled(tmp_path, clock):
    device = Device({b"\x0c\x00": TLV, b"quit\r": b"\x40\x01\x01" * 5}, b"", 1.0, b"never", None)
    sink, _ = record(TAGS["dwm1001-tlv"], device, tmp_path / "port", clock)
    assert set(sink.ranges) == {("022E", 3.44), ("9280", 5.68)}
    # Ten times a second for two seconds, and the request of the handshake.
    assert 10 <= device.log.count(b"\x0c\x00") <= 25


NOTE = (
    b"SESSION_INFO_NTF: {session_handle=1, sequence_number=0, block_index=7, n_measurements=1 "
    b'[mac_address=0x0001, status="SUCCESS", distance[cm]=152]}\r\n'
)
START = b"INITF -MULTI -BLOCK=200 -ADDR=0 -PADDR=[1,2,3,4]\r\n"


def test_dwm3001(tmp_path, clock):
    status = b'JS0109{"Info":{"Current App":"NONE","Version":"1.1.0"}}\r\nok\r\n'
    device = Device({b"STAT\r\n": status, b"STOP\r\n": b"ok\r\n"}, NOTE, 0.2, START, b"STOP\r\n")
    sink, identity = record(TAGS["dwm3001"], device, tmp_path / "port", clock)
    assert set(sink.ranges) == {("0001", 1.52)}
    assert "1.1.0" in identity["status"]
    assert not device.streaming


def test_mauwb(tmp_path, clock):
    line = b"AT+RANGE=tid:0,mask:01,seq:79,range:(522,0,0,0,0,0,0,0),rssi:(-70,0,0,0,0,0,0,0)\r\n"
    device = Device({}, line, 0.1, b"AT+SETRPT=1\r\n", b"AT+SETRPT=0\r\n")
    sink, _ = record(TAGS["mauwb"], device, tmp_path / "port", clock)
    assert set(sink.ranges) == {("A0", 5.22)}
    assert not device.streaming


def test_trek1000(tmp_path, clock):
    line = b"mc 03 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0\r\n"
    sink, _ = record(TAGS["trek1000"], Device({}, line, 0.1, None, None), tmp_path / "port", clock)
    assert set(sink.ranges) == {("A0", 1.635), ("A1", 1.443)}


def test_a_signal_waits_until_the_motor_is_stopped():
    order = []
    before = signal.signal(signal.SIGTERM, lambda *_: order.append("signal"))
    try:
        with unhurried():
            signal.raise_signal(signal.SIGTERM)
            order.append("stopped")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert order == ["stopped", "signal"]
