"""What every table and figure is made with: seeds, a pool of processes, results kept for resuming."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import slam_uwb
from slam_uwb.batch import run_tasks
from slam_uwb.evaluate import Interval, bootstrap_interval


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the paper beside what came out here."""

    text: str
    paper: str
    here: str
    tolerance: str
    holds: bool | None
    """None where too few seeds were run to tell."""


@dataclass(frozen=True, slots=True)
class Section:
    """One table or figure on the page."""

    title: str
    text: str
    """Markdown; pictures by their file names."""
    claims: tuple[Claim, ...] = ()


@dataclass(frozen=True, slots=True)
class Run:
    """One reproduction."""

    out: Path
    seeds: range
    quick: bool
    workers: int
    code: str
    """Checksum of the code, see `code_checksum`."""

    def write(self, name: str, content: bytes | str) -> None:
        """A file of the results."""
        data = content.encode() if isinstance(content, str) else content
        (self.out / name).write_bytes(data)

    def each(self, name: str, function: Callable[..., Any], tasks: Sequence[Any]) -> list[Any]:
        """`function(task)` of every task in other processes, in the order of the tasks.

        Each result is written down as it comes, under a checksum of the code: a run that was
        interrupted goes on where it stopped, and changed code starts afresh.
        """
        store = self.out / "cache" / self.code / f"{name}.jsonl"
        store.parent.mkdir(parents=True, exist_ok=True)
        done = _read(store)
        keys = [json.dumps(task) for task in tasks]
        missing = [key for key in keys if key not in done]
        outcomes = run_tasks(function, [json.loads(key) for key in missing], self.workers)
        with closing(outcomes), store.open("a") as stream:
            for count, outcome in enumerate(outcomes, start=1 + len(keys) - len(missing)):
                if outcome.error is not None:
                    raise outcome.error
                key = missing[outcome.index]
                done[key] = _plain(outcome.result)
                stream.write(json.dumps({"task": key, "result": done[key]}) + "\n")
                stream.flush()
                self.progress(name, count, len(keys))
        return [done[key] for key in keys]

    def progress(self, what: str, done: int, total: int) -> None:
        """One line on stderr."""
        end = "\n" if done == total else "\r" if sys.stderr.isatty() else ""
        if end:
            print(f"{what}: {done} of {total}   ", end=end, file=sys.stderr, flush=True)

    def interval(self, values: Any) -> Interval:
        """Median with its 95 % bootstrap interval; the same every time."""
        numbers = [np.nan if v is None else v for v in values]
        return bootstrap_interval(numbers, np.random.default_rng(0))


def shown(interval: Interval, unit: str = "m", decimals: int = 2) -> str:
    """`0.64 m [0.60, 0.68]`, or that there is none."""
    if not interval.count:
        return "none"
    text = f"{interval.value:.{decimals}f} {unit}".strip()
    if np.isfinite(interval.low):
        text += f" [{interval.low:.{decimals}f}, {interval.high:.{decimals}f}]"
    return text


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def code_checksum() -> str:
    """Of the package and of these scripts: what a stored result was made with."""
    package = Path(slam_uwb.__file__).parent
    total = hashlib.sha256()
    for folder in (package, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            total.update(path.read_bytes())
    return total.hexdigest()[:12]


def _read(store: Path) -> dict[str, Any]:
    done = {}
    for line in store.read_text().splitlines() if store.exists() else ():
        # A line that an interruption tore is made again.
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        done[entry["task"]] = entry["result"]
    return done


def _plain(value: Any) -> Any:
    """JSON without NaN: what is not known is None."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
