"""A survey folder that grows: what is written when, what a crash leaves, what recording again keeps."""

from __future__ import annotations

import tomllib
import tracemalloc
from datetime import UTC, datetime

import numpy as np
import pytest

from slam_uwb.io import (
    check_survey,
    known_radios,
    put_anchor,
    read_survey,
    read_time_zero,
    recorded_stations,
    recording_station,
    recording_upper_scan,
    start_survey,
)
from slam_uwb.io.growing_survey import put_station, remove_station
from slam_uwb.model.errors import SlamUwbError, SurveyFormatError

ZERO = datetime(2026, 5, 4, 3, 2, 1, tzinfo=UTC)
BEARINGS = np.deg2rad([0.0, 90.0, 180.0, 270.0])
RANGES = np.array([1.0, np.nan, 3.0, 4.0])
TIMES = np.arange(4) / 500


@pytest.fixture
def folder(tmp_path):
    lidar = {"model": "x", "angle_direction": "ccw", "max_range_m": 40.0}
    start_survey(tmp_path / "new", time_zero=ZERO, lidar=lidar, tag={"height_m": 1.4})
    return tmp_path / "new"


def fill(recording, times=TIMES):
    recording.add_scan(BEARINGS, RANGES, times, np.full(4, 150.0))
    recording.add_range("A1", 2.345, 0.1, float("nan"), "")
    recording.flush()


def complete_station(folder, name):
    with recording_station(folder, name, epoch=10.0) as recording:
        fill(recording)
        recording.finish(complete=True, log={"seconds": 60.0})


def test_a_station_is_in_the_survey_from_its_first_flush_on(folder):
    put_anchor(folder, "A1", 2.4)
    with recording_station(folder, "s01", epoch=10.0) as recording:
        assert recorded_stations(folder) == {}
        fill(recording)
        # A crash here: nothing else is called.
        check = check_survey(folder)
    assert check.faults == ()
    assert [str(w) for w in check.warnings if "broke off" in str(w)]
    station = check.survey.stations[0]
    assert not station.complete
    assert np.allclose(np.mod(station.scan.bearings, 2 * np.pi), BEARINGS)
    assert np.array_equal(station.scan.ranges, RANGES, equal_nan=True)
    assert check.survey.ranges[0].distances.tolist() == [2.345]
    assert (folder / "scans/s01.csv").read_text().splitlines()[1] == "0.0000,1.000,10.000,150"


def test_a_complete_station_says_nothing_of_it(folder):
    complete_station(folder, "s01")
    assert read_survey(folder).stations[0].complete
    assert "complete" not in (folder / "survey.toml").read_text()


def test_a_recording_without_any_return_is_no_fault(folder):
    with recording_station(folder, "s01", epoch=0.0) as recording:
        recording.add_scan(BEARINGS, np.full(4, np.nan), TIMES, np.full(4, 30.0))
        recording.flush()
        assert recorded_stations(folder) == {}
        recording.add_range("A1", 2.0, 0.1, -80.5, "RX OK, 5")
        recording.flush()
        assert recorded_stations(folder)["s01"].files == ()
        fill(recording)
    assert recorded_stations(folder)["s01"].files == ("scans/s01.csv",)
    assert (folder / "ranges.csv").read_text().splitlines()[
        1
    ] == "s01,A1,2.000,0.100,-80.50,RX_OK__5"
    assert len(read_survey(folder).stations[0].scan.ranges) == 8


def test_recording_again_keeps_what_was_recorded(folder):
    put_anchor(folder, "A1", 2.4)
    complete_station(folder, "s01")
    complete_station(folder, "s02")
    for _ in range(2):
        with recording_station(folder, "s01", epoch=20.0) as recording:
            # Even before anything arrives the survey is sound, without the old recording.
            assert list(recorded_stations(folder)) == ["s02"]
            assert check_survey(folder).faults == ()
            fill(recording)
            recording.finish(complete=True, log={})
    assert (folder / "ranges.csv").read_text().count("s01,") == 1
    for number in ("1", "2"):
        aside = folder / "recordings/replaced/s01" / number
        assert (aside / "scans-s01.csv").exists()
        assert (
            (aside / "ranges.csv").read_text().splitlines()[0].startswith("station,anchor,range_m")
        )


def test_names_that_look_alike_do_not_mix(folder):
    complete_station(folder, "s01-2")
    complete_station(folder, "s01")
    complete_station(folder, "s01")
    assert (folder / "scans/s01-2.csv").exists()
    with pytest.raises(SlamUwbError, match="S01"), recording_station(folder, "S01", epoch=0.0):
        pass


@pytest.mark.parametrize("name", ["..", ".", "../x", "a/b", "", "-s", "a" * 65, "s 1"])
def test_names_that_are_none(folder, name):
    with pytest.raises(SlamUwbError), recording_station(folder, name, epoch=0.0):
        pass


def test_a_row_that_a_crash_tore_is_left_out_when_the_survey_is_gone_on_with(folder):
    put_anchor(folder, "A1", 2.4)
    complete_station(folder, "s01")
    with (folder / "ranges.csv").open("a") as stream:
        stream.write("s01,A1,2.3")
    complete_station(folder, "s02")
    assert check_survey(folder).faults == ()
    assert (folder / "ranges.csv").read_text().count("\n") == 3


def test_a_table_of_other_columns_is_gone_on_with(folder):
    put_anchor(folder, "A1", 2.4)
    complete_station(folder, "s01")
    (folder / "ranges.csv").write_text("anchor,range_m,station,colour\nA1,1.5,s01,red\n")
    complete_station(folder, "s02")
    survey = read_survey(folder)
    assert [link.distances.tolist() for link in survey.ranges] == [[1.5], [2.345]]


def test_a_table_that_is_none_is_named(folder):
    (folder / "ranges.csv").write_text("x" * 20_000)
    with pytest.raises(SurveyFormatError, match=r"ranges\.csv"):
        complete_station(folder, "s01")


def test_a_long_recording_goes_on_in_further_files(folder):
    with recording_station(folder, "s01", epoch=0.0) as recording:
        recording.scan.max_bytes = 300
        for k in range(10):
            fill(recording, TIMES + k)
        recording.finish(complete=True, log={})
    files = recorded_stations(folder)["s01"].files
    assert files[:2] == ("scans/s01.csv", "scans/parts/s01/2.csv")
    assert len(read_survey(folder).stations[0].scan.ranges) == 40


def test_memory_does_not_grow_with_the_recording(folder):
    bearings, ranges = np.linspace(0, 6, 500), np.full(500, 2.0)
    peaks = []
    tracemalloc.start()
    try:
        with recording_station(folder, "s01", epoch=0.0, keep_raw=True) as recording:
            for second in range(60):
                recording.add_scan(bearings, ranges, second + np.arange(500) / 500, ranges)
                recording.add_range("A1", 2.0, second, float("nan"), "")
                recording.add_raw("sweep", bytes(3500))
                recording.flush()
                peaks.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    # 1.4 MB were written between these two.
    assert peaks[-1] - peaks[4] < 50_000


def test_what_a_person_wrote_into_survey_toml_stays(folder):
    path = folder / "survey.toml"
    path.write_text(path.read_text().replace("height_m = 1.4", "height_m = 1.4  # by hand"))
    with path.open("a") as stream:
        stream.write('\n[[stations]]\nid = "s01"  # by the door\ntag_height_m = 1.5\n')
    complete_station(folder, "s01")
    complete_station(folder, "s01")
    assert "# by hand" in path.read_text()
    assert "# by the door" in path.read_text()
    assert read_survey(folder).stations[0].tag_height == 1.5


def test_stations_may_come_and_go(folder):
    # tomlkit alone writes no TOML after the only table of an array was removed.
    for _ in range(3):
        put_station(folder, "s01", files=["scans/s01.csv"], complete=False)
        put_anchor(folder, "A1", 2.4)
        remove_station(folder, "s01")
        assert recorded_stations(folder) == {}
    put_station(folder, "s02", files=[], complete=True)
    assert tomllib.loads((folder / "survey.toml").read_text())["stations"] == [{"id": "s02"}]


def test_anchors(folder):
    put_anchor(folder, "022E", None)
    put_anchor(folder, "022E", 2.4)
    assert known_radios(folder) == {"022E": 2.4}
    for radio, height in (("a b", 2.0), ("A2", 240.0), ("A2", float("nan"))):
        with pytest.raises(SlamUwbError):
            put_anchor(folder, radio, height)


def test_going_on_with_a_survey_changes_nothing_of_it(folder):
    before = (folder / "survey.toml").read_bytes()
    start_survey(folder, time_zero=datetime.now(UTC), lidar={"model": "y"}, tag={"height_m": 9.0})
    assert (folder / "survey.toml").read_bytes() == before
    assert read_time_zero(folder) == ZERO


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SlamUwbError, match="no survey folder"):
        start_survey(tmp_path, time_zero=ZERO, lidar={}, tag={})


def test_raw_bytes_are_kept_on_request(folder):
    for keep in (False, True):
        with recording_station(folder, "s01", epoch=0.0, keep_raw=keep) as recording:
            recording.add_raw("sweep", b"\x00\x01")
            recording.add_raw("sweep", b"\x02")
            fill(recording)
        path = folder / "recordings/raw/s01/sweep.bin"
        assert path.exists() == keep
    assert path.read_bytes() == b"\x00\x01\x02"


def raised(folder, name="s01", *, complete=True, height_m=2.5, keep_raw=False):
    with recording_upper_scan(
        folder, name, height_m=height_m, epoch=20.0, keep_raw=keep_raw
    ) as recording:
        recording.add_scan(BEARINGS, RANGES + 1.0, TIMES, np.full(4, 150.0))
        recording.add_range("A1", 9.0, 0.1, float("nan"), "")
        recording.add_raw("sweep", b"raw")
        recording.finish(complete=complete, log={"seconds": 60.0})


def test_a_raised_scan_belongs_to_its_station(folder):
    put_anchor(folder, "A1", 2.4)
    complete_station(folder, "s01")
    ranges = (folder / "ranges.csv").read_text()
    raised(folder, keep_raw=True)
    check = check_survey(folder)
    assert (check.faults, check.warnings) == ((), ())
    (station,) = check.survey.stations
    assert station.upper_scan_height == 2.5
    np.testing.assert_allclose(station.upper_scan.ranges, RANGES + 1.0)
    np.testing.assert_allclose(station.scan.ranges, RANGES)
    # The tag may hang higher meanwhile: its ranges are no measurement of this survey.
    assert (folder / "ranges.csv").read_text() == ranges
    assert (folder / "recordings/raw/upper/s01/sweep.bin").read_bytes() == b"raw"
    assert (folder / "recordings/log/upper/s01.json").exists()


def test_a_raised_scan_that_broke_off_is_not_named(folder):
    complete_station(folder, "s01")
    raised(folder, complete=False)
    assert read_survey(folder).stations[0].upper_scan is None
    assert (folder / "scans/upper/s01.csv").exists()
    raised(folder, height_m=2.6)
    assert read_survey(folder).stations[0].upper_scan_height == 2.6
    assert (folder / "recordings/replaced/s01/1/upper-s01.csv").exists()


def test_a_station_recorded_again_loses_its_raised_scan_but_not_the_file(folder):
    complete_station(folder, "s01")
    raised(folder)
    complete_station(folder, "s01")
    station = read_survey(folder).stations[0]
    assert (station.upper_scan, station.upper_scan_height) == (None, None)
    kept = {path.name for path in (folder / "recordings/replaced/s01/1").iterdir()}
    assert {"scans-s01.csv", "upper-s01.csv", "log-s01.json"} <= kept


@pytest.mark.parametrize(
    ("name", "height_m", "told"),
    [("s02", 2.5, "own scan first"), ("s01", 250.0, "metres"), ("../s", 2.5, "own scan first")],
)
def test_no_raised_scan(folder, name, height_m, told):
    complete_station(folder, "s01")
    with pytest.raises(SlamUwbError, match=told):
        raised(folder, name, height_m=height_m)
    assert read_survey(folder).stations[0].upper_scan is None
