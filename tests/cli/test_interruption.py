"""Ctrl-C, kill and a closed terminal: 130, and nothing half-written."""

import signal
import subprocess
from functools import partial

import pytest


@pytest.fixture
def interrupt(program):
    return partial(run_and_interrupt, program)


def listen():
    """Hear signals even where the suite itself runs in the background and ignores them."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def run_and_interrupt(program, arguments, stage, number):
    """Run, wait for the log line of a stage of the work, send the signal."""
    with subprocess.Popen(
        [program, *map(str, arguments), "--verbose"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=listen,
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
