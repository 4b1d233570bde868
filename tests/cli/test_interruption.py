"""Ctrl-C, kill and a closed terminal: 130, and nothing half-written."""

import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from slam_uwb.cli.interruption import Interrupted, interruptible


@pytest.fixture
def interrupt(program, children_hear_signals):
    return partial(run_and_interrupt, program)


def run_and_interrupt(program, arguments, stage, number):
    """Run, wait for the log line of a stage of the work, send the signal."""
    with subprocess.Popen(
        [program, *map(str, arguments), "--verbose"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        lines = iter(process.stderr.readline, "")
        assert any(stage in line for line in lines), "the stage was never reached"
        process.send_signal(number)
        stdout, stderr = process.communicate(timeout=60)
    return process.returncode, stdout, stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_solve_leaves_nothing(interrupt, pristine_survey, tmp_path, number):
    status, stdout, stderr = interrupt(
        ["solve", pristine_survey, "--out", tmp_path / "out"], "matching scans: 1 of", number
    )
    assert (status, stdout) == (130, "")
    assert "interrupted" in stderr.splitlines()[-1]
    assert "Traceback" not in stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("stage", ["matching scans: 1 of", "drawing and writing: 0 of"])
def test_an_interrupted_solve_leaves_the_old_solution(
    interrupt, pristine_survey, solution, contents, stage
):
    before = contents(solution.parent)
    status, _, _ = interrupt(["solve", pristine_survey, "--out", solution], stage, signal.SIGINT)
    assert status == 130
    assert contents(solution.parent) == before


def test_workers_end_quietly_too(interrupt, pristine_survey, tmp_path):
    status, _, stderr = interrupt(
        ["solve", pristine_survey, "--out", tmp_path / "out", "--workers", 2],
        "matching scans: 1 of",
        signal.SIGINT,
    )
    assert status == 130
    assert "Traceback" not in stderr
    assert list(tmp_path.iterdir()) == []


def test_a_job_that_ignores_interrupts_goes_on(program, pristine_survey, tmp_path):
    # As a shell starts a job in the background: Ctrl-C is for the one in front.
    out = tmp_path / "out"
    ignoring = ["sh", "-c", "trap '' INT; exec \"$@\"", "sh"]
    command = [program, "solve", str(pristine_survey), "--out", str(out), "--verbose"]
    with subprocess.Popen(
        [*ignoring, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert any("matching scans: 1 of" in line for line in iter(process.stderr.readline, ""))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 0
    assert (out / "solution.json").is_file()


class Closing:
    """Something whose destructor is Python code, as that of a dropped generator is."""

    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


def test_an_interrupt_that_a_destructor_swallows_comes_again():
    lost = []
    with pytest.raises(Interrupted), interruptible():  # noqa: PT012
        Closing()
        lost.append(True)
        time.sleep(10.0)
    assert lost == [True]
    assert sys.unraisablehook.__module__ != "slam_uwb.cli.interruption"
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL


def test_other_errors_in_destructors_are_told_as_ever(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: told.append(lost.exc_type))

    class Broken:
        def __del__(self):
            raise ValueError

    with interruptible() as came:
        Broken()
    assert told == [ValueError]
    assert came == []


TRACE = """
import signal, sys
from slam_uwb.cli import application

def work(*_):
    try:
        signal.raise_signal(signal.SIGTERM)
    except BaseException as error:
        raise {error} from error

application.application = work
application.main()
"""


@pytest.mark.parametrize("error", ["RuntimeError('release unlocked lock')", "OSError(4, 'call')"])
def test_an_error_made_of_an_interrupt_is_one(error):
    done = subprocess.run(
        [sys.executable, "-c", TRACE.format(error=error)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 130, done.stderr
    assert "interrupted" in done.stderr
