import numpy as np
import pytest

from slam_uwb.capture.frames import rplidar
from slam_uwb.capture.samples import Carry, lidar_samples


def node(start, quality, degrees, millimetres):
    angle, distance = round(degrees * 64), round(millimetres * 4)
    return bytes(
        [
            quality << 2 | (1 if start else 2),
            (angle & 0x7F) << 1 | 1,
            angle >> 7,
            distance & 0xFF,
            distance >> 8,
        ]
    )


def revolutions(number, points=20):
    return b"".join(
        node(k % points == 0, 15, (k % points) * 360 / points, 1000 + k)
        for k in range(number * points)
    )


def decode_standard(data):
    return rplidar.decode_standard(data, Carry(), last=True)


@pytest.mark.parametrize(
    ("recorded", "degrees", "metres", "quality"),
    [
        # Recorded nodes of the protocol notes, 2.4.
        ("3e8ba7340e", 335.078125, 0.909, 15),
        ("2e11a8fd0d", 336.125, 0.89525, 11),
        ("02b3400000", 129.390625, np.nan, 0),
    ],
)
def test_recorded_nodes(recorded, degrees, metres, quality):
    stream = revolutions(1) + bytes.fromhex(recorded) + revolutions(1)
    samples = decode_standard(stream).samples
    # The device counts clockwise.
    assert np.rad2deg(samples.bearings[20]) == pytest.approx(360.0 - degrees, abs=1e-9)
    assert np.array_equal(samples.ranges[20:21], [metres], equal_nan=True)
    assert samples.signals[20] == quality


def test_samples_before_the_first_start_are_stale():
    found = decode_standard(revolutions(3)[5 * 7 :])
    assert len(found.samples) == 40
    assert found.samples.starts.tolist() == [0, 20]
    assert found.tally.dropped == {"samples before first start": 13}


def test_starts_are_kept_over_chunks():
    stream = bytes.fromhex("a55a0500004081") + revolutions(4)
    first = rplidar.decode_standard(stream[:233], Carry())
    second = rplidar.decode_standard(stream[233:], first.carry, last=True)
    assert len(first.samples) + len(second.samples) == 80


def capsule(begin, first, body):
    word = round(begin * 64) | (0x8000 if first else 0)
    inner = bytes([word & 0xFF, word >> 8]) + body
    check = 0
    for byte in inner:
        check ^= byte
    return bytes([0xA0 | check & 0xF, 0x50 | check >> 4]) + inner


def express_body(millimetres, offset):
    cabins = b""
    for k in range(16):
        words = [(mm << 2) | offset >> 4 for mm in (millimetres + 10 * k, millimetres + 10 * k + 5)]
        nibbles = (offset & 0xF) | (offset & 0xF) << 4
        cabins += words[0].to_bytes(2, "little") + words[1].to_bytes(2, "little") + bytes([nibbles])
    return cabins


def test_express_example():
    # Protocol notes, 2.5: start 10 degrees, raw offsets 56 and 57 (7 and 7.125 degrees, unsigned).
    head = bytes.fromhex("80 82 a3 0f b7 0f 98")
    rest = express_body(1010, 0)[:75]
    body = head[2:] + rest
    stream = capsule(10.0, True, body) + capsule(24.4, False, body)
    assert stream[2:9] == head
    found = rplidar.decode_express(stream, Carry(), last=True)
    assert len(found.samples) == 32
    degrees = 360.0 - np.rad2deg(found.samples.bearings[:2])
    # 24.4 degrees are 1561.6 / 64, sent as 1562: a span of 14.40625 in 32 steps.
    assert degrees == pytest.approx([3.0, 10 + 14.40625 / 32 - 7.125], abs=1e-9)
    assert found.samples.ranges[:2].tolist() == [1.0, 1.005]


def test_dense_example():
    # Protocol notes, 2.6: 350 to 358.64 degrees, 2000 mm and on.
    body = b"".join((2000 + k).to_bytes(2, "little") for k in range(40))
    stream = capsule(350.0, False, body) + capsule(358.64, False, body)
    assert stream[:8] == bytes.fromhex("a7 5d 80 57 d0 07 d1 07")
    samples = rplidar.decode_dense(stream, Carry(), last=True).samples
    assert 360.0 - np.rad2deg(samples.bearings[:2]) == pytest.approx([350.0, 350.2156], abs=1e-3)
    assert samples.ranges[:2].tolist() == [2.0, 2.001]


def test_dense_capsules_of_a_recording_are_those_of_the_notes():
    """350 degrees clockwise is 10 counter-clockwise; played backwards, the last sample comes first."""
    degrees = np.array([350.0 + 0.216 * k for k in range(80)])[::-1]
    metres = np.array([2.0 + 0.001 * k for k in range(80)])[::-1].copy()
    metres[5] = np.nan
    samples = lidar_samples(degrees, metres, np.zeros(80), np.zeros(0, int), clockwise=True)
    sent = rplidar.encode_dense(samples)
    assert len(sent) == 2 * rplidar.CAPSULE
    # As test_dense_example, but marked as the first after a reset: bit 15 changes byte 3 and the check.
    assert sent[2:8] == bytes.fromhex("80 d7 d0 07 d1 07")
    found = rplidar.decode_dense(sent, Carry(), last=True).samples
    # A sixty-fourth of a degree is the capsules' step: half of one at either end.
    turned = np.rad2deg(found.bearings - samples.bearings[::-1][:40])
    assert np.abs((turned + 180.0) % 360.0 - 180.0).max() < 1.01 / 64
    assert found.ranges == pytest.approx(metres[::-1][:40])
    assert (
        rplidar.encode_dense(
            lidar_samples(degrees[:39], metres[:39], metres[:39], np.zeros(0, int))
        )
        == b""
    )


def turning(number):
    """Capsules of 12 degrees: 30 a revolution."""
    body = express_body(2000, 0)
    return [capsule((12.0 * k) % 360.0, k == 0, body) for k in range(number)]


def test_revolutions_of_capsules_in_any_chunks():
    stream = b"".join(turning(70))
    whole = rplidar.decode_express(stream, Carry(), last=True).samples
    assert len(whole) == 69 * 32
    # Sample 30 * 32 is at 360 degrees.
    assert whole.starts.tolist() == [960, 1920]
    carry, starts, count = Carry(), [], 0
    for k in range(0, len(stream), 100):
        found = rplidar.decode_express(stream[k : k + 100], carry)
        starts += [count + start for start in found.samples.starts.tolist()]
        carry, count = found.carry, count + len(found.samples)
    assert starts == [960, 1920]
    assert count == 69 * 32


def test_a_damaged_capsule_costs_itself_and_the_one_before():
    capsules = turning(10)
    capsules[5] = capsules[5][:40] + bytes([capsules[5][40] ^ 1]) + capsules[5][41:]
    found = rplidar.decode_express(b"".join(capsules), Carry(), last=True)
    assert len(found.samples) == 7 * 32
    assert found.tally.dropped["capsules without successor"] == 1
