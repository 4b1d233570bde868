"""Memory and load of what is measured."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

INTERVAL_S = 0.05


def run_measured(command: Sequence[str]) -> tuple[float, float]:
    """Wall time in s and peak proportional set size in MB, all processes together, of a command.

    Proportional: a page that several processes share is counted once. Linux alone tells it; NaN
    elsewhere.
    """
    start = time.perf_counter()
    peak = float("nan")
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        while process.poll() is None:
            peak = max(_tree_kilobytes(process.pid), 0.0 if peak != peak else peak)
            time.sleep(INTERVAL_S)
        wall = time.perf_counter() - start
        if process.returncode != 0:
            said = process.stderr.read().decode() if process.stderr else ""
            raise RuntimeError(f"{' '.join(command)}: status {process.returncode}: {said}")
    return wall, peak / 1000.0


def load() -> list[float]:
    """Load averages over 1, 5 and 15 minutes: beside other work every time is too long."""
    return [round(value, 2) for value in os.getloadavg()]


def _tree_kilobytes(pid: int) -> float:
    total = 0.0
    waiting = [pid]
    while waiting:
        at = waiting.pop()
        try:
            text = Path(f"/proc/{at}/smaps_rollup").read_text()
            waiting += map(int, Path(f"/proc/{at}/task/{at}/children").read_text().split())
        except (OSError, ValueError):
            # Ended in between.
            continue
        total += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
    return total
