"""How far the work is, on stderr: a bar where a person looks on, log lines with ``--verbose``."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, int, int], None]

PATIENCE_S = 1.0
"""Work that ends sooner shows no bar."""

_log = logging.getLogger(__name__)


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Yield what a step calls with (what is being done, how many done, how many in all).

    Silent where stderr is no terminal.
    """
    if _log.isEnabledFor(logging.DEBUG):
        # Log lines would tear a bar.
        yield _log_progress
    elif sys.stderr.isatty():
        with _bars() as report:
            yield report
    else:
        yield lambda _what, _done, _total: None


def _log_progress(what: str, done: int, total: int) -> None:
    # A line a pair would drown the rest.
    if done in (0, 1, total):
        _log.debug("%s: %d of %d", what, done, total)


@contextmanager
def _bars() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    bars = Bars(console=Console(stderr=True), transient=True)
    tasks: dict[str, TaskID] = {}
    start = time.monotonic()

    def report(what: str, done: int, total: int) -> None:
        if what not in tasks:
            tasks[what] = bars.add_task(what, total=total)
        bars.update(tasks[what], completed=done, total=total)
        if time.monotonic() - start > PATIENCE_S:
            bars.start()

    try:
        yield report
    finally:
        bars.stop()


@contextmanager
def rate_bar(noun: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yield what is called with the name of each of `total` things when it is done.

    One bar with how many a minute and the time left; log lines with ``--verbose``; silent where
    stderr is no terminal.
    """
    if _log.isEnabledFor(logging.DEBUG) or not sys.stderr.isatty():
        numbers = iter(range(1, total + 1))
        yield lambda what: _log.debug("%s: %d of %d: %s", noun, next(numbers), total, what)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    rate = TextColumn("{task.fields[rate]}")
    with Bars(*columns, rate, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(noun, total=total, rate="")
        start = time.monotonic()

        def advance(_what: str) -> None:
            bar.advance(task)
            a_minute = 60.0 * bar.tasks[0].completed / max(time.monotonic() - start, 1e-9)
            bar.update(task, rate=f"{a_minute:.1f} a minute")

        yield advance
