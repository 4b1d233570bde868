import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam_uwb.capture.frames import sweep
from slam_uwb.capture.samples import Carry, LidarSamples


def decode(data: bytes):
    return sweep.decode(data, Carry(), last=True)


@pytest.mark.parametrize(
    ("block", "degrees", "metres", "strength", "starts"),
    [
        # The examples of the protocol notes: 0x0005 / 16 degrees, 0x019c cm.
        ("0105009c01bb5f", 0.3125, 4.12, 187, [0]),
        ("007f1601000096", 359.9375, np.nan, 0, []),
    ],
)
def test_examples(block, degrees, metres, strength, starts):
    samples = decode(bytes.fromhex(block)).samples
    assert np.rad2deg(samples.bearings).tolist() == [degrees]
    assert np.array_equal(samples.ranges, [metres], equal_nan=True)
    assert samples.signals.tolist() == [strength]
    assert samples.starts.tolist() == starts


def test_a_sample_with_an_error_bit_is_dropped_and_counted():
    found = decode(bytes.fromhex("02b107a00fff6a"))
    assert len(found.samples) == 0
    assert found.tally.dropped == {"device error": 1}


def test_a_revolution_that_begins_with_an_error_is_still_a_new_one():
    # Sync and error bit: 03, azimuth 0, 1 m: 03+64 = 0x67.
    bad_sync = bytes.fromhex("03000064000067")
    sample = bytes.fromhex("00100064000074")
    samples = decode(sample + bad_sync + sample + bad_sync).samples
    assert len(samples) == 2
    assert samples.starts.tolist() == [1, 2]


def test_the_checksum_is_modulo_255():
    # 00 d0 02 ff 00 00 sums to 465: 210 modulo 255, 209 modulo 256.
    assert decode(bytes.fromhex("00d002ff0000d2")).tally.frames == 1
    assert decode(bytes.fromhex("00d002ff0000d1")).tally.frames == 0


def random_samples(rng, number):
    ranges = np.where(rng.random(number) < 0.1, np.nan, rng.integers(2, 4000, number) / 100)
    return LidarSamples(
        np.deg2rad(rng.integers(0, 5760, number) / 16),
        ranges,
        rng.integers(0, 200, number).astype(float),
        np.arange(0, number, 25),
    )


def test_what_is_encoded_is_decoded():
    samples = random_samples(np.random.default_rng(0), 500)
    found = decode(sweep.encode(samples))
    for name in ("bearings", "ranges", "signals", "starts"):
        assert np.array_equal(
            getattr(found.samples, name), getattr(samples, name), equal_nan=name != "starts"
        )
    assert found.tally.dropped == {}


@given(st.binary(max_size=300))
def test_any_bytes_are_survived_in_bounded_memory(data):
    found = sweep.decode(data, Carry())
    assert len(found.carry.rest) < 7 * 6
    assert found.tally.frames * 7 <= len(data)


@given(st.binary(max_size=50), st.integers(0, 1000))
def test_the_stream_is_found_after_any_garbage(garbage, seed):
    samples = random_samples(np.random.default_rng(seed), 20)
    found = decode(garbage + sweep.encode(samples)).samples
    assert np.array_equal(found.ranges[-18:], samples.ranges[-18:], equal_nan=True)


def test_a_turned_over_bit_costs_one_sample():
    samples = random_samples(np.random.default_rng(1), 100)
    stream = bytearray(sweep.encode(samples))
    stream[50 * 7 + 3] ^= 0x04
    found = decode(bytes(stream))
    assert np.array_equal(found.samples.ranges, np.delete(samples.ranges, 50), equal_nan=True)
