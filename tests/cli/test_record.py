"""`slam-uwb record` against emulated instruments: what is asked, what is written, how it ends."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from slam_uwb.capture.clock import Clock
from slam_uwb.capture.emulator import (
    Dwm1001Emulator,
    Faults,
    SweepEmulator,
    play_survey,
    plugged_in,
)
from slam_uwb.io import check_survey, recorded_stations
from slam_uwb.simulate import Lidar, Radio, simulate_survey

SPEED = 8
"""An emulator that a busy machine holds up for a tenth of a second must not cost most of a recording."""


@dataclass
class Setup:
    """Instruments at two ports."""

    sweep: SweepEmulator
    tag: Dwm1001Emulator
    arguments: list[str]
    faults: dict[Path, Faults]


@pytest.fixture
def setup(tmp_path: Path) -> Iterator[Setup]:
    with instruments(tmp_path, upper=False) as made:
        yield made


@pytest.fixture
def raising_setup(tmp_path: Path) -> Iterator[Setup]:
    """Its scanner is raised at every station."""
    with instruments(tmp_path, upper=True) as made:
        yield made


@contextmanager
def instruments(tmp_path: Path, *, upper: bool) -> Iterator[Setup]:
    lidar = Lidar(duration=3.0, upper_duration=3.0 if upper else 0.0)
    survey = simulate_survey("flat", 3, lidar=lidar, radio=Radio(duration=3.0)).survey
    tripod = play_survey(survey, 500.0, upper=upper)
    sweep, tag = SweepEmulator(tripod), Dwm1001Emulator(tripod)
    ports = {tmp_path / "sweep": sweep, tmp_path / "tag": tag}
    arguments = ["--lidar", f"sweep:{tmp_path / 'sweep'}", "--uwb", f"dwm1001:{tmp_path / 'tag'}"]
    faults: dict[Path, Faults] = {}
    with plugged_in(ports, clock=Clock(SPEED), faults=faults):
        yield Setup(sweep, tag, [*arguments, "--speed", str(SPEED), "--seconds", "3"], faults)


def record(program: str, folder: Path, setup: Setup, answers: list[str], *more: str):
    return subprocess.run(
        [program, "record", str(folder), *setup.arguments, *more],
        input="".join(f"{answer}\n" for answer in answers),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_a_guided_session(program, setup, tmp_path):
    folder = tmp_path / "survey"
    # The tag's height in centimetres first; then s01 and the heights of its five anchors.
    answers = [
        "140",
        "1.40",
        "",
        "2.4",
        "2,5",
        "25.0",
        "n",
        "high",
        "2.6",
        "",
        "-",
        "../x",
        "",
        "q",
    ]
    done = record(program, folder, setup, answers, "--raw")
    assert done.returncode == 0, done.stderr
    assert "Scanse Sweep on" in done.stdout
    assert "points a revolution" in done.stdout
    assert "a station's name is" in done.stdout
    assert "'high' is no number" in done.stdout
    # Asked at s01 and not again at s02.
    assert done.stdout.count("height of anchor D005") == 1
    assert "one station so far" in done.stdout
    assert "o station, A anchor, x go there next" in done.stdout
    assert f"2 stations in {folder}. The same command goes on" in done.stdout
    assert "2 of 2 placed" in done.stdout
    assert "█" in done.stdout
    assert "next (x in the map): " in done.stdout
    check = check_survey(folder)
    assert check.faults == ()
    survey = check.survey
    assert [station.id for station in survey.stations] == ["s01", "s02"]
    assert all(station.complete for station in survey.stations)
    assert survey.stations[0].tag_height == 1.4
    assert [(anchor.id, anchor.height) for anchor in survey.anchors] == [
        ("D001", 2.4),
        ("D002", 2.5),
        ("D003", 2.6),
        ("D004", None),
    ]
    # The fifth is somebody else's: heard, but not listed.
    assert any("D005" in str(warning) for warning in check.warnings)
    log = json.loads((folder / "recordings/log/s01.json").read_text())
    assert log["instruments"][0]["serial"] == "00002152"
    assert log["scan"]["tally"]["received"] == (
        (folder / "recordings/raw/s01/sweep.bin").stat().st_size
    )
    assert setup.sweep.motor == 0


def test_a_session_is_gone_on_with_and_heights_are_asked_once(program, setup, tmp_path):
    folder = tmp_path / "survey"
    first = record(program, folder, setup, ["1.4", "", *["2.4"] * 5, "q"], "--no-solve")
    assert first.returncode == 0, first.stderr
    again = record(program, folder, setup, ["", "s01", "y", "q"], "--no-solve")
    assert again.returncode == 0, again.stderr
    assert "Height" not in again.stdout
    assert "height of anchor" not in again.stdout
    assert list(recorded_stations(folder)) == ["s02", "s01"]
    # What was recorded first is not lost.
    kept = folder / "recordings/replaced/s01/1"
    assert (kept / "scans-s01.csv").exists()
    assert (kept / "ranges.csv").read_text().count("s01,") > 10
    assert check_survey(folder).faults == ()


def test_after_unplugging_the_station_is_recorded_again(program, setup, tmp_path):
    folder = tmp_path / "survey"
    (sweep,) = [Path(a.partition(":")[2]) for a in setup.arguments if a.startswith("sweep:")]
    setup.faults[sweep] = Faults(unplug_at=1.0, replug_after=0.0)
    # s01 breaks off; its anchors are heard all the same; Enter connects again, Enter records s01 again.
    answers = ["1.4", "", *["2.4"] * 5, "", "", "q"]
    done = record(program, folder, setup, answers, "--no-solve")
    assert done.returncode == 0, done.stderr
    assert "broke off" in done.stdout
    assert "unplugged" in done.stderr
    assert recorded_stations(folder)["s01"].complete


def test_a_raised_scan_at_each_station(program, raising_setup, tmp_path):
    folder = tmp_path / "survey"
    # s01 and its five anchors, the raised scan at 2.4 m; s02, at the height proposed; s03, without.
    answers = ["1.4", "", *["2.4"] * 5, "2,4", "", "", "", "-", "q"]
    done = record(program, folder, raising_setup, answers, "--upper", "--no-solve")
    assert done.returncode == 0, done.stderr
    assert "station s02, raised scan recorded" in done.stdout
    check = check_survey(folder)
    assert check.faults == ()
    stations = check.survey.stations
    assert [s.upper_scan_height for s in stations] == [2.4, 2.5, None]
    assert [s.upper_scan is not None for s in stations] == [True, True, False]
    # What the raised scanner saw, not the station's own scan once more.
    played = raising_setup.sweep.tripod.stations[1].scan.ranges
    seen = stations[0].upper_scan.ranges
    number = min(len(seen), len(played))
    assert number > 500
    np.testing.assert_allclose(seen[:number], played[:number], atol=0.0051, equal_nan=True)
    # The tag is left alone meanwhile: half as many reports again would be twice as many rows.
    rows = (folder / "ranges.csv").read_text().splitlines()
    assert sum(row.startswith("s01,") for row in rows) < 5 * 3 * 10 * 1.4


def test_a_raised_scan_that_breaks_off_is_taken_after_connecting_again(
    program, raising_setup, tmp_path
):
    folder = tmp_path / "survey"
    (sweep,) = [
        Path(a.partition(":")[2]) for a in raising_setup.arguments if a.startswith("sweep:")
    ]

    def pull_out_when_raised():
        while not (folder / "scans/upper/s01.csv").exists():
            time.sleep(0.005)
        raising_setup.faults[sweep] = Faults(unplug_at=0.0, replug_after=0.0)

    thread = threading.Thread(target=pull_out_when_raised, daemon=True)
    thread.start()
    # Enter connects again; then the height is asked for s01 once more.
    answers = ["1.4", "", *["2.4"] * 5, "", "", "2.6", "q"]
    more = ("--upper", "--no-solve", "--seconds", "6")
    done = record(program, folder, raising_setup, answers, *more)
    assert done.returncode == 0, done.stderr
    assert "raised scan broke off" in done.stdout
    (station,) = check_survey(folder).survey.stations
    assert station.complete
    assert station.upper_scan_height == 2.6
    assert raising_setup.sweep.motor == 0


def test_an_instrument_that_fails_for_good_ends_with_4(program, setup, tmp_path):
    folder = tmp_path / "survey"
    (sweep,) = [Path(a.partition(":")[2]) for a in setup.arguments if a.startswith("sweep:")]
    setup.faults[sweep] = Faults(unplug_at=1.0, replug_after=1e9)
    done = record(program, folder, setup, ["1.4", "", *["2.4"] * 5, "q"], "--no-solve")
    assert done.returncode == 4
    assert not recorded_stations(folder)["s01"].complete


@pytest.mark.usefixtures("children_hear_signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_the_motor_and_keeps_what_was_recorded(program, setup, tmp_path, number):
    folder = tmp_path / "survey"
    setup.arguments[setup.arguments.index("--seconds") + 1] = "600"
    process = subprocess.Popen(
        [program, "record", str(folder), *setup.arguments, "--tag-height-m", "1.4"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        process.stdin.write("s01\n")
        process.stdin.flush()
        # Only to start: a busy machine takes its time to load the program.
        deadline = time.monotonic() + 60.0
        while not (folder / "ranges.csv").exists():
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(number)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 130
    assert "station s01 broke off: what it has is kept" in errors
    assert "interrupted" in errors
    assert setup.sweep.motor == 0
    assert not setup.sweep.streaming
    assert not setup.tag.reporting
    assert check_survey(folder).faults == ()
    assert not recorded_stations(folder)["s01"].complete


@pytest.mark.usefixtures("children_hear_signals")
@pytest.mark.parametrize("times", [1, 5])
def test_a_signal_while_the_operator_is_asked(program, setup, tmp_path, times):
    with subprocess.Popen(
        [program, "record", str(tmp_path / "survey"), *setup.arguments, "--tag-height-m", "1.4"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        told = b""
        while b"Set up the tripod" not in told:
            more = os.read(process.stdout.fileno(), 4096)
            assert more, process.stderr.read()
            told += more
        # The motor turns while the operator carries the tripod.
        assert setup.sweep.motor == 2
        for _ in range(times):
            # An impatient operator: the later ones must not kill the program before the motor stands.
            process.send_signal(signal.SIGINT)
            time.sleep(0.02)
        _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert errors.splitlines()[-1].startswith(b"slam-uwb: interrupted")
    assert setup.sweep.motor == 0


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        ([], 2, "name at least one instrument"),
        (["--uwb", "dwm1001:/dev/null", "--upper"], 2, "--lidar"),
        (["--lidar", "swep:/dev/ttyUSB0"], 2, "sweep"),
        (["--lidar", "sweep:/dev/there-is-none"], 4, "no such port"),
        (["--lidar", "sweep:ffff:ffff"], 4, "slam-uwb ports"),
        (["--uwb", "dwm1001:/dev/null", "--tag-height-m", "140"], 2, "height"),
        (["--uwb", "dwm1001:/dev/null", "--tag-height-m", "1.4"], 4, "/dev/null"),
    ],
)
def test_what_cannot_be_started(run, tmp_path, arguments, status, told):
    done = run("record", tmp_path / "survey", *arguments)
    assert done.returncode == status, done.stderr
    assert told in done.stderr


def test_a_folder_of_something_else_is_left_alone(run, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    done = run("record", tmp_path, "--lidar", "sweep:/dev/there-is-none")
    assert done.returncode == 2
    assert "nothing was changed" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_ports(run):
    done = run("ports", "--json")
    assert done.returncode == 0
    assert isinstance(json.loads(done.stdout), list)
    assert "sweep" in run("ports").stdout


class Terminal:
    """A program in a terminal of its own; `screen` is all that it drew, without its colours."""

    def __init__(self, arguments: list[str], columns: int, lines: int) -> None:
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        # Where these are set they are believed before the terminal itself.
        environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")}
        self.process = subprocess.Popen(
            arguments,
            env=environment,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
        )
        os.close(slave)
        self.screen = ""

    def answer(self, question: str, line: str) -> None:
        """Type a line once the question stands there, anew."""
        begin, deadline = len(self.screen), time.monotonic() + 60.0
        while question not in self.screen[begin:]:
            assert time.monotonic() < deadline, self.screen
            self._read()
        os.write(self.master, f"{line}\n".encode())

    def end(self) -> int:
        with suppress(OSError):
            while True:
                self._read()
        os.close(self.master)
        return self.process.wait(20.0)

    def _read(self) -> None:
        text = os.read(self.master, 65536).decode("utf-8", "replace")
        self.screen += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


def test_in_a_terminal(program, setup, tmp_path):
    """A live picture whose lines do not run into each other, and no line broken inside a word."""
    arguments = [program, "record", str(tmp_path / "survey"), *setup.arguments, "--no-solve"]
    terminal = Terminal(arguments, 60, 24)
    terminal.answer("antenna above the floor in m", "1.4")
    terminal.answer("Enter records s01", "")
    for _ in range(5):
        terminal.answer("height of anchor", "2.4")
    terminal.answer("Enter records s02", "q")
    assert terminal.end() == 0
    lines = re.split(r"[\r\n]+", terminal.screen)
    bars = [line for line in lines if "━" in line]
    assert bars
    assert all(set(line.rstrip()) <= set("━╸╺ ") for line in bars)
    assert any(re.match(r"lidar  25\d points a revolution, ", line) for line in lines)
    assert max(map(len, (line for line in lines if "serial" in line or "rotation" in line))) <= 60
    assert "rotation hz 02" in terminal.screen.replace("\r\n  ", " ")
    assert "1 station in" in terminal.screen


@pytest.mark.usefixtures("children_hear_signals")
@pytest.mark.parametrize("lidar", ["sweep", "rplidar-c1-dense"])
def test_without_instruments(program, run, pristine_survey, tmp_path, lidar):
    """As the page on recording has it: one program plays the instruments, the other records them."""
    ports, speed = tmp_path / "ports", str(SPEED)
    with subprocess.Popen(
        [program, "emulate", pristine_survey, "--ports", ports, "--lidar", lidar, "--speed", speed],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as emulator:
        try:
            told = [emulator.stdout.readline().split() for _ in range(2)]
            assert told == [
                ["lidar", f"{lidar}:{ports / lidar}"],
                ["uwb", f"dwm1001:{ports / 'dwm1001'}"],
            ]
            done = subprocess.run(
                [program, "record", tmp_path / "survey", "--lidar", told[0][1], "--uwb", told[1][1],
                 "--seconds", "3", "--speed", speed, "--no-solve", "--tag-height-m", "1.4"],
                input="\n" + 5 * "2.4\n" + "q\n", capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
        finally:
            emulator.send_signal(signal.SIGINT)
        assert emulator.wait(20.0) == 130
    assert done.returncode == 0, done.stderr
    (station,) = check_survey(tmp_path / "survey").survey.stations
    assert station.complete
    assert np.isfinite(station.scan.ranges).sum() > 1000
