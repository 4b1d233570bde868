"""Laws of every decoder of fixed frames, on a protocol made for the test: 7E, three bytes, their sum."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slam_uwb.capture.frames.framing import Framing, find_frames
from slam_uwb.capture.samples import Carry, Tally


def sound_at(stream):
    places = len(stream) - 4
    sums = sum(stream[k : k + places].astype(int) for k in (1, 2, 3)) % 256
    return (stream[:places] == 0x7E) & (sums == stream[4:])


FRAMING = Framing(5, sound_at)


def frame(a: int, b: int, c: int) -> bytes:
    return bytes([0x7E, a, b, c, (a + b + c) % 256])


def decode_in_chunks(framing: Framing, data: bytes, cuts: list[int]):
    carry, frames, tally = Carry(), [], Tally()
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, end in pairwise(edges):
        found = find_frames(framing, carry, data[start:end])
        assert len(found.carry.rest) <= framing.length * (framing.compare + framing.confirm + 2)
        carry, tally = found.carry, tally + found.tally
        frames.append(found.frames)
    found = find_frames(framing, carry, b"", last=True)
    return np.concatenate([*frames, found.frames]), tally + found.tally


# Many headers and many right sums by chance: the hard case.
hostile = st.lists(st.sampled_from([0x7E, 0x00, 0x01, 0xFC, 0xFA]), max_size=60).map(bytes)
sound = st.lists(st.builds(frame, *[st.integers(0, 255)] * 3), max_size=8).map(b"".join)
streams = st.lists(st.one_of(hostile, sound, st.binary(max_size=40)), max_size=6).map(b"".join)


@given(streams, st.lists(st.integers(0, 300), max_size=8))
def test_cutting_a_stream_into_chunks_changes_nothing(data, cuts):
    whole, tally = decode_in_chunks(FRAMING, data, [])
    frames, cut_tally = decode_in_chunks(FRAMING, data, cuts)
    assert np.array_equal(whole, frames)
    assert tally == cut_tally


@given(streams)
def test_every_byte_is_in_a_frame_or_counted(data):
    frames, tally = decode_in_chunks(FRAMING, data, [])
    assert tally.received == len(data)
    assert tally.frames == len(frames)
    assert tally.frames * 5 + tally.dropped.get("bytes outside frames", 0) == len(data)
    assert all(sound_at(row).all() for row in frames)


@given(st.binary(max_size=60), st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=3))
def test_frames_are_found_after_any_garbage(garbage, contents):
    frames, _ = decode_in_chunks(FRAMING, garbage + b"".join(frame(*c) for c in contents), [])
    # A header inside the garbage's last bytes may pass its test by chance and win over one sound frame
    # that it overlaps, never over two.
    found = [tuple(row[1:4].tolist()) for row in frames]
    assert found[-(len(contents) - 1) :] == contents[1:]


@settings(max_examples=30)
@given(st.binary(min_size=1, max_size=200))
def test_where_the_test_is_weak_several_frames_must_follow_each_other(data):
    weak = Framing(2, lambda stream: stream[:-1] % 2 == 0, confirm=4, compare=4)
    frames, _ = decode_in_chunks(weak, data, [])
    assert len(frames) == 0 or len(frames) >= 4


def test_a_damaged_frame_costs_itself_only():
    contents = [(k, k, k) for k in range(20)]
    stream = bytearray(b"".join(frame(*c) for c in contents))
    stream[5 * 7 + 2] ^= 0x10
    del stream[5 * 13 + 1]
    frames, tally = decode_in_chunks(FRAMING, bytes(stream), [])
    assert [row[1] for row in frames.tolist()] == [k for k in range(20) if k not in (7, 13)]
    assert tally.dropped == {"bytes outside frames": 9, "lost sync": 2}


def test_a_chance_frame_does_not_hide_the_true_ones_behind_it():
    # 7E 01 7E 01 80: a header and 01 + 7E + 01 = 80, two bytes before the stream begins.
    contents = [(1, 0x80, 5), (2, 2, 2), (3, 3, 3)]
    frames, tally = decode_in_chunks(
        FRAMING, b"\x7e\x01" + b"".join(frame(*c) for c in contents), []
    )
    assert [tuple(row[1:4].tolist()) for row in frames] == contents
    assert tally.dropped == {"bytes outside frames": 2}
