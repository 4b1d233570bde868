from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam_uwb.capture.frames import dwm1001
from slam_uwb.capture.frames.lines import MAX_LINE
from slam_uwb.capture.samples import Carry, RangeEpoch, RangeReading, Tally

# Both recorded from real devices (protocol notes, 5.2).
LES = (
    "022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 DCAE[0.00,8.03,0.00]=7.73 "
    "5431[0.00,0.00,0.00]=9.01 le_us=3082 est[6.97,5.17,-1.77,53]"
)
LEC = (
    "DIST,3,AN0,2F2F,3.05,2.68,0.00,2.20,AN1,2ED0,3.02,0.00,0.00,2.23,"
    "AN2,2BA2,0.00,0.00,0.00,3.13,POS,1.76,1.59,0.51,40"
)


def readings(line):
    epoch = dwm1001.parse_report(line)
    return None if epoch is None else [(item.anchor, item.distance) for item in epoch.readings]


def test_les():
    assert readings(LES) == [("022E", 3.38), ("9280", 5.49), ("DCAE", 7.73), ("5431", 9.01)]


def test_lec():
    assert readings(LEC) == [("2F2F", 2.20), ("2ED0", 2.23), ("2BA2", 3.13)]


def test_a_position_is_not_needed_and_a_prompt_may_stand_before():
    assert readings("dwm> 022E[7.94,8.03,0.00]=-0.02 le_us=3082") == [("022E", -0.02)]


@pytest.mark.parametrize(
    "line",
    [
        # Recorded: two reports spliced.
        "9280[7.95,0.00,0.00]=5.49 14A6[0.00,0.01539[2.00,0.00,0.00]=0.83 1B95[1.00,1.00,0.00]=2.00 le_us=1",
        "DIST,4,AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,2.10",
        # Whole fields of two reports.
        "022E[7.94,8.03,0.00]=3.38 022E[7.94,8.03,0.00]=3.39 le_us=3082",
        LEC.replace("DIST,3", "DIST,4"),
        LEC.replace("AN1", "AN0"),
        LEC.replace("2ED0", "2F2F"),
        LES + LES,
        LES[:-1],
        LES.replace("3.38", "3.3"),
    ],
)
def test_a_spliced_or_cut_line_is_garbled(line):
    assert readings(line) is None
    found = dwm1001.decode(f"{line}\r\n".encode(), Carry())
    assert found.samples == ()
    assert found.tally.dropped == {"garbled lines": 1}


def test_echo_prompt_and_other_answers_are_no_reports():
    text = "les\r\ndwm> \r\n sys: fw2 fw_ver=x01030001\r\n" + LES + "\r\n"
    found = dwm1001.decode(text.encode(), Carry())
    assert found.tally == Tally(len(text), 1, {})


@given(
    st.lists(
        st.one_of(
            st.binary(max_size=40),
            st.sampled_from([LES.encode(), LEC.encode(), b"\r\n", b"\n", b"x" * (MAX_LINE + 7)]),
        ),
        max_size=8,
    ).map(b"".join),
    st.lists(st.integers(0, 4500), max_size=6),
)
def test_cutting_the_stream_changes_nothing_and_memory_is_bounded(data, cuts):
    whole = dwm1001.decode(data, Carry(), last=True)
    carry, epochs, tally = Carry(), [], Tally()
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, end in pairwise(edges):
        found = dwm1001.decode(data[start:end], carry)
        assert len(found.carry.rest) <= MAX_LINE
        carry, tally = found.carry, tally + found.tally
        epochs += found.samples
    found = dwm1001.decode(b"", carry, last=True)
    assert [*epochs, *found.samples] == list(whole.samples)
    assert tally + found.tally == whole.tally


@given(st.binary(max_size=200))
def test_a_report_is_found_after_any_garbage(garbage):
    found = dwm1001.decode(garbage + b"\r\n" + LES.encode() + b"\r\n", Carry())
    assert len(found.samples[-1]) == 4


def test_what_is_encoded_is_decoded():
    epoch = RangeEpoch((RangeReading("D001", 3.384), RangeReading("D002", -0.004)))
    (found,) = dwm1001.decode(dwm1001.encode(epoch), Carry()).samples
    assert [item.distance for item in found.readings] == [3.38, 0.0]
