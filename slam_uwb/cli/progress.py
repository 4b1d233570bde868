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
