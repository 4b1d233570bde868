"""The paper's office, recorded through serial ports from emulated instruments, against the simulated folder."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from slam_uwb.capture.emulator import radio_names
from slam_uwb.capture.recorder import record_station
from slam_uwb.io import (
    check_survey,
    put_anchor,
    read_survey,
    recording_station,
    start_survey,
    write_survey,
)
from slam_uwb.pipeline import solve_survey

BEGUN = datetime(2026, 1, 1, tzinfo=UTC)


def record(bench, survey, folder: Path, seconds: float, stations=None):
    start_survey(
        folder,
        time_zero=BEGUN,
        lidar={"model": "emulated", "angle_direction": "ccw", "max_range_m": 25.0},
        tag={"height_m": survey.stations[0].tag_height},
    )
    radios = radio_names(survey)
    for anchor in survey.anchors:
        put_anchor(folder, radios[anchor.id], anchor.height)
    with bench.connect() as instruments:
        for number, station in enumerate((stations or survey).stations):
            with recording_station(folder, station.id, epoch=100.0 * number) as recording:
                report = record_station(instruments, seconds, recording, clock=bench.clock)
                assert report.problem is None
                # Rates are told by the host's clock, which hurries here; what was received is whole.
                assert report.live.scan.tally.dropped == {}
                recording.finish(complete=True, log={})


def test_the_recorded_office_is_solved_as_the_simulated_one(make_bench, paper_office, tmp_path):
    # Bytes are dated when they are fetched, late on a busy machine: two seconds more than was simulated.
    folder, seconds = tmp_path / "recorded", 6.0
    record(make_bench(paper_office, speed=40.0), paper_office, folder, seconds)
    check = check_survey(folder)
    assert check.faults == ()
    assert check.warnings == ()
    recorded = check.survey

    # The emulator repeats a station until it is stopped: what was simulated comes first, unchanged.
    counts = []
    for simulated, station in zip(paper_office.stations, recorded.stations, strict=True):
        number = len(simulated.scan.ranges)
        assert len(station.scan.ranges) >= number
        turned = station.scan.bearings[:number] - simulated.scan.bearings[:number]
        assert np.abs(np.angle(np.exp(1j * turned))).max() < 1e-6
        assert np.allclose(
            station.scan.ranges[:number],
            simulated.scan.ranges[:number],
            atol=1e-9,
            rtol=0,
            equal_nan=True,
        )
        counts.append(number)
    radios = radio_names(paper_office)
    measured = {(str(link.station), radios[link.anchor]): link for link in paper_office.ranges}
    heard = {(str(link.station), str(link.anchor)): link for link in recorded.ranges}
    assert heard.keys() == measured.keys()
    for key, link in heard.items():
        expected = measured[key].distances
        # A DWM1001 prints centimetres.
        assert len(link.distances) >= len(expected)
        assert np.abs(link.distances[: len(expected)] - expected).max() <= 0.005 + 1e-9

    # The same samples on both sides, so that nothing but the rounding differs.
    write_survey(paper_office, tmp_path / "simulated")
    compare(
        solve_survey(read_survey(tmp_path / "simulated")),
        solve_survey(cut(recorded, counts, [len(measured[key].distances) for key in heard])),
        radios,
    )


def cut(survey, samples, readings):
    """The first samples of each scan and readings of each link."""
    return replace(
        survey,
        stations=tuple(
            replace(
                station,
                scan=replace(
                    station.scan,
                    bearings=station.scan.bearings[:number],
                    ranges=station.scan.ranges[:number],
                ),
            )
            for station, number in zip(survey.stations, samples, strict=True)
        ),
        ranges=tuple(
            replace(link, distances=link.distances[:number])
            for link, number in zip(survey.ranges, readings, strict=True)
        ),
    )


def compare(simulated, recorded, radios):
    assert [s.status for s in simulated.stations] == [s.status for s in recorded.stations]
    assert [a.status for a in simulated.anchors] == [a.status for a in recorded.anchors]
    assert sum(s.status == "ok" for s in recorded.stations) == 18
    for a, b in zip(simulated.stations, recorded.stations, strict=True):
        # Centimetres of ranges weigh little against scans that are the same to the digit.
        assert np.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y) < 0.005
    for a, b in zip(simulated.anchors, recorded.anchors, strict=True):
        assert radios[a.id] == b.id
        if a.position is not None:
            # Half a centimetre at most of each range; three ranges at a blunt angle make a few of it.
            assert np.linalg.norm(a.position - b.position) < 0.02
