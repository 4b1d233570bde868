"""The program from outside: how soon it starts, and many surveys at once."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from measure import run_measured

from slam_uwb import simulate_survey, write_survey
from slam_uwb.simulate import Lidar

PROGRAM = str(Path(sys.executable).with_name("slam-uwb"))
WORKERS = 2


def bench_help(benchmark: Any) -> None:
    def show() -> None:
        subprocess.run([PROGRAM, "--help"], check=True, capture_output=True)

    benchmark.pedantic(show, rounds=15, warmup_rounds=2)
    benchmark.extra_info["program"] = "help"


def bench_batch(benchmark: Any, scratch: Path, request: pytest.FixtureRequest) -> None:
    count = request.config.getoption("--batch")
    folder = scratch / "flats"
    for seed in range(count):
        made = simulate_survey("flat", seed, lidar=Lidar(duration=10.0))
        write_survey(made.survey, folder / f"flat-{seed:02d}")
    start = time.perf_counter()
    for survey in sorted(folder.iterdir()):
        command = [PROGRAM, "solve", str(survey), "--out", str(scratch / "single" / survey.name)]
        subprocess.run(command, check=True, capture_output=True)
    single = time.perf_counter() - start
    out = scratch / "together"
    peaks = []

    def together() -> None:
        command = [PROGRAM, "batch", str(folder), "--out", str(out), "--workers", str(WORKERS)]
        peaks.append(run_measured(command)[1])

    benchmark.pedantic(together, setup=lambda: shutil.rmtree(out, ignore_errors=True), rounds=1)
    benchmark.extra_info.update(
        program="batch", count=count, workers=WORKERS, single_s=single, peak_mb=max(peaks)
    )
