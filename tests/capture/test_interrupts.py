"""A signal between any two instructions: the motor stands still, and what was recorded is sound."""

from __future__ import annotations

import signal
import sys
from contextlib import contextmanager
from datetime import UTC, datetime

import pytest

from slam_uwb.capture.recorder import record_station
from slam_uwb.capture.signals import signals_held
from slam_uwb.cli.interruption import Interrupted, interruptible
from slam_uwb.io import check_survey, recorded_stations, recording_station, start_survey

LIDAR = {"model": "emulated", "angle_direction": "ccw", "max_range_m": 40.0}


@contextmanager
def signals_after(function, called, number, times=1):
    """Send SIGTERM right after the `number`-th call of the C function `called` in `function`."""
    seen = [0]

    def profile(frame, event, argument):
        if event != "c_return" or frame.f_code.co_qualname != function:
            return
        if getattr(argument, "__name__", "") == called:
            seen[0] += 1
            if number <= seen[0] < number + times:
                signal.raise_signal(signal.SIGTERM)

    sys.setprofile(profile)
    try:
        yield seen
    finally:
        sys.setprofile(None)


def record(bench, folder):
    with (
        interruptible(),
        signals_held(),
        bench.connect() as instruments,
        recording_station(folder, "s01", epoch=0.0) as recording,
    ):
        report = record_station(instruments, 3.0, recording, clock=bench.clock)
        recording.finish(complete=report.problem is None, log={})


@pytest.mark.parametrize(
    ("function", "called", "number", "times"),
    [
        # The stack of what is to be closed has just let go of one: its call would be lost.
        *(("ExitStack.__exit__", "pop", number, 1) for number in (1, 3, 4, 6, 7)),
        # Waiting for bytes: the queue's lock is released, and would be released once more.
        ("Condition._release_save", "release", 5, 1),
        ("Condition._acquire_restore", "acquire", 5, 1),
        # An impatient operator: one signal at each look for answers, handshakes and stops included.
        ("Port._wait", "select", 1, 10_000),
        # While a file is brought to the disk.
        ("append_durably", "fsync", 1, 2),
    ],
)
def test_a_signal_at_a_bad_moment(make_bench, flat, tmp_path, function, called, number, times):
    bench, folder = make_bench(flat), tmp_path / "survey"
    start_survey(
        folder,
        time_zero=datetime(2026, 1, 1, tzinfo=UTC),
        lidar=LIDAR,
        tag={"height_m": 1.4},
    )
    with signals_after(function, called, number, times) as seen, pytest.raises(Interrupted):
        record(bench, folder)
    assert seen[0] >= number
    assert bench.sweep.motor == 0
    assert not bench.sweep.streaming
    assert not bench.tag.reporting
    if recorded_stations(folder):
        assert check_survey(folder).faults == ()
