"""What breaks while a survey is recorded costs the station of the moment, and motors stand still after it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from slam_uwb.capture.emulator import Faults
from slam_uwb.capture.ports import LIDARS, connected
from slam_uwb.capture.recorder import record_station
from slam_uwb.io import check_survey, recorded_stations, recording_station, start_survey
from slam_uwb.model.errors import CaptureError

LIDAR = {"model": "emulated", "angle_direction": "ccw", "max_range_m": 40.0}


@pytest.fixture
def folder(tmp_path):
    start_survey(
        tmp_path / "survey",
        time_zero=datetime(2026, 1, 1, tzinfo=UTC),
        lidar=LIDAR,
        tag={"height_m": 1.4},
    )
    return tmp_path / "survey"


def record(bench, instruments, folder, station, seconds=3.0):
    with recording_station(folder, station, epoch=0.0) as recording:
        report = record_station(instruments, seconds, recording, clock=bench.clock)
        recording.finish(complete=report.problem is None, log={})
    return report


def contents(folder, station):
    rows = (folder / "ranges.csv").read_text().splitlines()
    return (folder / f"scans/{station}.csv").read_bytes(), [
        row for row in rows if row.startswith(f"{station},")
    ]


def test_damaged_bytes_cost_samples_and_are_told(make_bench, flat, folder):
    bench = make_bench(flat, faults=Faults(noise=0.002, torn=0.001, inserted=0.001))
    with bench.connect() as instruments:
        report = record(bench, instruments, folder, "s01")
    assert report.problem is None
    assert sum(report.live.scan.tally.dropped.values()) > 20
    assert any("damaged" in doubt for doubt in report.doubts)
    survey = check_survey(folder).survey
    recorded, true = survey.stations[0].scan, flat.stations[0].scan
    # About 2 % of blocks of seven bytes are hit.
    assert len(recorded.ranges) > 0.9 * 1500
    # A checksum of one byte lets one damaged block in 255 pass: none here is far from the true ones.
    known = {
        (round(float(np.rad2deg(b) % 360 * 16)), round(float(r) * 100))
        for b, r in zip(true.bearings, true.ranges, strict=True)
        if np.isfinite(r)
    }
    foreign = sum(
        (round(float(np.rad2deg(b) % 360 * 16)), round(float(r) * 100)) not in known
        for b, r in zip(recorded.bearings, recorded.ranges, strict=True)
        if np.isfinite(r)
    )
    assert foreign <= 3


def test_a_silent_scanner_breaks_the_station_off(make_bench, flat, folder):
    bench = make_bench(flat, faults=Faults(stall_at=1.5))
    with bench.connect() as instruments:
        report = record(bench, instruments, folder, "s01")
    assert isinstance(report.problem, CaptureError)
    assert "fell silent" in str(report.problem)
    assert not recorded_stations(folder)["s01"].complete
    check = check_survey(folder)
    assert check.faults == ()
    assert 600 < len(check.survey.stations[0].scan.ranges) < 900
    assert bench.sweep.motor == 0


def test_unplugging_at_any_moment_loses_no_finished_station(make_bench, flat, folder, tmp_path):
    rng = np.random.default_rng(0)
    bench = make_bench(flat, speed=40.0, faults=Faults())
    plug = bench.sweep
    with bench.connect() as instruments:
        assert record(bench, instruments, folder, "s01").problem is None
    finished = contents(folder, "s01")
    for moment in rng.uniform(0.05, 2.9, 10):
        bench.unplug_sweep(float(moment))
        with bench.connect() as instruments:
            report = record(bench, instruments, folder, "s02")
        assert "unplugged" in str(report.problem)
        assert contents(folder, "s01") == finished
        check = check_survey(folder)
        assert check.faults == ()
        stations = recorded_stations(folder)
        assert stations["s01"].complete
        assert "s02" not in stations or not stations["s02"].complete
        bench.await_sweep()
    with bench.connect() as instruments:
        assert record(bench, instruments, folder, "s02").problem is None
    assert all(station.complete for station in recorded_stations(folder).values())
    assert contents(folder, "s01") == finished
    assert plug.motor == 0


def test_a_scanner_that_never_begins_a_revolution_is_told(make_bench, flat, folder):
    # Firmware below 1.4 after a reset: sound checksums, no sync.
    bench = make_bench(flat)
    tripod = bench.sweep.tripod
    scan = replace(tripod.station.scan, starts=np.empty(0, dtype=np.int64))
    tripod.stations = (replace(tripod.station, scan=scan), *tripod.stations[1:])
    with bench.connect() as instruments:
        report = record(bench, instruments, folder, "s01")
    assert "no revolution begins" in str(report.problem)
    assert not recorded_stations(folder)["s01"].complete


class StopError(Exception):
    pass


def test_the_motor_stands_still_after_an_error_in_the_middle(make_bench, flat, folder):
    bench = make_bench(flat)

    def fail(_live):
        raise StopError

    with pytest.raises(StopError), bench.connect() as instruments:  # noqa: PT012
        assert bench.sweep.motor == 2
        with recording_station(folder, "s01", epoch=0.0) as recording:
            record_station(instruments, 3.0, recording, watch=fail, clock=bench.clock)
    assert bench.sweep.motor == 0
    assert not bench.sweep.streaming
    assert not bench.tag.reporting


def test_the_motor_stands_still_after_an_error_while_it_spins_up(make_bench, flat):
    bench = make_bench(flat)
    # Longer than anybody waits, but not for ever: the motor refuses to be stopped before that, too.
    bench.sweep.settling = 16.0
    bench.sweep.power_on(bench.clock.now())
    with (
        pytest.raises(CaptureError, match="motor is not stable"),
        connected(LIDARS["sweep"], str(bench.folder / "sweep"), bench.clock),
    ):
        pass
    assert bench.sweep.motor == 0


def test_an_instrument_left_streaming_is_taken_over(make_bench, flat, folder):
    bench = make_bench(flat)
    with bench.connect():
        pass
    bench.sweep.motor, bench.sweep._ready_at = 2, 0.0
    bench.sweep.receive(b"DS\n", bench.clock.now())
    bench.tag.receive(b"\r\rles\r", bench.clock.now())
    assert bench.sweep.streaming
    assert bench.tag.reporting
    with bench.connect() as instruments:
        assert not bench.tag.reporting
        assert record(bench, instruments, folder, "s01").problem is None


def test_the_tag_s_slow_rate_at_rest_is_warned_of(make_bench, flat):
    bench = make_bench(flat)
    bench.tag.stationary_rate = 100
    with bench.connect() as (_, tag):
        assert "every 10 s" in tag.identity["warning"]


def test_another_device_at_the_port_is_no_sweep(make_bench, flat):
    bench = make_bench(flat)
    with (
        pytest.raises(CaptureError, match=r"tag"),
        connected(LIDARS["sweep"], str(bench.folder / "tag"), bench.clock),
    ):
        pass


def test_a_port_in_use_is_refused(make_bench, flat):
    bench = make_bench(flat)
    with (
        bench.connect(),
        pytest.raises(CaptureError, match="in use"),
        connected(LIDARS["sweep"], str(bench.folder / "sweep"), bench.clock),
    ):
        pass
