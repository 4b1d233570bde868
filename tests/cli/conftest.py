"""The program as a user runs it, and one small survey that every test shares."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

PROGRAM = str(Path(sys.executable).with_name("slam-uwb"))
Run = Callable[..., subprocess.CompletedProcess[str]]


def run_program(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    # A terminal's width would wrap the messages that the tests look for.
    environment = {**os.environ, "COLUMNS": "200"}
    return subprocess.run(
        [PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment,
        timeout=120,
        check=False,
    )


@pytest.fixture(scope="session")
def program() -> str:
    """The console script's path."""
    return PROGRAM


@pytest.fixture
def children_hear_signals() -> Iterator[None]:
    """A suite that runs in the background ignores Ctrl-C, and a child would inherit that; a handler is not."""
    before = {
        number: signal.signal(number, signal.default_int_handler)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(number) is signal.SIG_IGN
    }
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def run() -> Run:
    """Run the console script; the result has returncode, stdout and stderr."""
    return run_program


@pytest.fixture(scope="session")
def pristine_survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small flat with little recorded; not to be changed."""
    folder = tmp_path_factory.mktemp("survey") / "flat"
    done = run_program("simulate", "flat", "--seed", 1, "--duration-s", 4, "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def survey(pristine_survey: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(pristine_survey, tmp_path / "flat"))


@pytest.fixture(scope="session")
def pristine_solution(pristine_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The solution of that survey; not to be changed."""
    out = tmp_path_factory.mktemp("solution") / "out"
    done = run_program("solve", pristine_survey, "--out", out)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture
def solution(pristine_solution: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(pristine_solution, tmp_path / "out"))


@pytest.fixture(scope="session")
def contents() -> Callable[[Path], dict[str, bytes]]:
    """All files below a folder with their bytes: equal means untouched."""

    def read(folder: Path) -> dict[str, bytes]:
        files = (path for path in sorted(folder.rglob("*")) if path.is_file())
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}

    return read
