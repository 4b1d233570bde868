import numpy as np
import pytest

from slam_uwb.capture.frames import ld06
from slam_uwb.capture.samples import Carry

# The frame of the vendor's manual.
MANUAL = bytes.fromhex(
    "54 2C 68 08 AB 7E E0 00 E4 DC 00 E2 D9 00 E5 D5 00 E3 D3 00 E4 D0 00 E9 CD 00 E4 CA 00 E2 C7 00 E9"
    "C5 00 E5 C2 00 E5 C0 00 E5 BE 82 3A 1A 50"
)


def frame(start, end, distance=1000):
    body = bytes.fromhex("542c6808") + round(start * 100).to_bytes(2, "little")
    body += (distance.to_bytes(2, "little") + b"\x64") * 12
    body += round(end * 100).to_bytes(2, "little") + b"\x00\x00"
    return body + ld06.checksum(np.frombuffer(body, dtype=np.uint8)[None]).tobytes()


def test_the_manual_s_frame():
    samples = ld06.decode(MANUAL, Carry(), last=True).samples
    degrees = 360.0 - np.rad2deg(samples.bearings)
    assert degrees[[0, -1]] == pytest.approx([324.27, 334.70], abs=1e-9)
    assert np.diff(degrees) == pytest.approx(0.9482, abs=1e-4)
    assert samples.ranges[[0, 1, 2, -1]].tolist() == [0.224, 0.220, 0.217, 0.192]
    assert samples.signals[[0, 1, 2, -1]].tolist() == [228, 226, 229, 229]


def test_distance_zero_is_no_return_whatever_the_intensity():
    assert np.isnan(ld06.decode(frame(10, 20, 0), Carry(), last=True).samples.ranges).all()


def test_a_frame_over_zero_begins_a_revolution_inside():
    # 355 to 4.9 degrees in steps of 0.9: the sixth step passes 360.
    samples = ld06.decode(frame(355, 4.9), Carry(), last=True).samples
    assert samples.starts.tolist() == [6]


def test_a_revolution_that_begins_between_frames():
    first = ld06.decode(frame(349, 359), Carry(), last=True)
    second = ld06.decode(frame(0, 10), first.carry, last=True)
    assert first.samples.starts.tolist() == []
    assert second.samples.starts.tolist() == [0]


@pytest.mark.parametrize("place", range(47))
def test_every_turned_over_bit_is_seen(place):
    spoilt = bytearray(MANUAL)
    spoilt[place] ^= 0x08
    assert ld06.decode(bytes(spoilt), Carry(), last=True).tally.frames == 0
