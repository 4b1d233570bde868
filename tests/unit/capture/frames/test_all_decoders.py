"""What holds for the decoder of every device, so that a newcomer is tested at once."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam_uwb.capture.ports import LIDARS, TAGS
from slam_uwb.capture.samples import Carry, LidarSamples, Tally

DEVICES = {device.name: device for device in (*LIDARS.values(), *TAGS.values())}
# What a decoder looks out for, so that random bytes come past its first test.
PIECES = [
    b"\x54\x2c", b"\xa5\x5a", b"\xa0\x50" + bytes(82), b"\x40\x01\x00\x41\x0d", b"\x3e\x8b\xa7\x34\x0e" * 9,
    bytes(14), b"le_us=1\r\n", b"DIST,1,AN0,", b"mc 0f 00000663\r\n", b"AT+RANGE=tid:1,\r\n", b'{"Block":1,',
    b"SESSION_INFO_NTF: {", b"}\r\n", b"[" * 50, b"\r", b"\n",
]  # fmt: skip
streams = st.lists(st.one_of(st.binary(max_size=100), st.sampled_from(PIECES)), max_size=12).map(
    b"".join
)
MAX_REST = 2_100


def outcome(decoded):
    samples = decoded.samples
    if isinstance(samples, LidarSamples):
        return [samples.bearings, samples.ranges, samples.signals]
    return [np.array([r.distance for epoch in samples for r in epoch.readings])]


@pytest.mark.parametrize("name", DEVICES)
@settings(max_examples=60, deadline=None)
@given(streams, st.lists(st.integers(0, 800), max_size=5))
def test_any_stream_in_any_chunks(name, data, cuts):
    decode = DEVICES[name].decode
    whole = decode(data, Carry(), last=True)
    carry, parts, tally = Carry(), [], Tally()
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, end in pairwise(edges):
        found = decode(data[start:end], carry)
        assert len(found.carry.rest) + len(found.carry.previous) <= 2 * MAX_REST
        carry, tally = found.carry, tally + found.tally
        parts.append(outcome(found))
    found = decode(b"", carry, last=True)
    parts.append(outcome(found))
    for together, pieces in zip(outcome(whole), zip(*parts, strict=True), strict=True):
        assert np.array_equal(together, np.concatenate(pieces), equal_nan=True)
    assert tally + found.tally == whole.tally
    assert whole.tally.received == len(data)


@pytest.mark.parametrize("name", LIDARS)
@settings(max_examples=30, deadline=None)
@given(streams)
def test_samples_of_a_scanner_are_in_their_limits(name, data):
    samples = LIDARS[name].decode(data, Carry(), last=True).samples
    assert ((samples.bearings >= 0) & (samples.bearings < 2 * np.pi)).all()
    assert not (samples.ranges <= 0).any()
    assert (np.diff(samples.starts) > 0).all()
