"""Tasks in processes of this machine.

One executor a process: where one breaks, it is known which task broke it, and the others go on. The
results cannot depend on the number of processes: each task is a pure function of its own arguments,
in a process whose linear algebra has one thread.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context, parent_process
from types import FrameType
from typing import TypeVar

from .outcome import Outcome, ProcessLostError

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 2
"""A process that ended may have been the victim of another's memory; a second one was not."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Read by the libraries of linear algebra when they are loaded."""
_BEAT_S, _BEATS_A_SIGNAL = 0.05, 40
"""A process that is to stop clears up after its task first: it is signalled again only every two seconds."""


@dataclass(frozen=True, slots=True)
class _Worker:
    """One process behind its own executor."""

    pool: ProcessPoolExecutor
    pid: int


def map_tasks(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[Result]:
    """`function(task)` of every task, in the order of the tasks, whatever the number of processes.

    Raises:
        Exception: the first that a task raised; the tasks not yet begun are left.
        ProcessLostError: two processes ended over the same task.
    """
    results: dict[int, Result] = {}
    with closing(run_tasks(function, tasks, workers)) as outcomes:
        for outcome in outcomes:
            if outcome.error is not None:
                raise outcome.error
            results[outcome.index] = outcome.result  # type: ignore[assignment]
            progress(len(results), len(tasks))
    return [results[index] for index in range(len(tasks))]


def run_tasks(
    function: Callable[[Task], Result], tasks: Sequence[Task], workers: int
) -> Generator[Outcome[Result], None, None]:
    """Outcomes of all tasks as they come; closing the iterator ends the processes at once.

    Args:
        function: importable by name, as its tasks and results travel between processes.
        tasks: each is worked on once; once more where its process ended without an answer.
        workers: processes.
    """
    waiting = deque((index, 1) for index in range(len(tasks)))
    idle: list[_Worker] = []
    running: dict[Future[Result], tuple[_Worker, int, int]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                index, attempt = waiting.popleft()
                worker = idle.pop() if idle else _start()
                running[worker.pool.submit(function, tasks[index])] = (worker, index, attempt)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                worker, index, attempt = running.pop(future)
                error = future.exception()
                if not isinstance(error, BrokenProcessPool):
                    idle.append(worker)
                    yield _outcome(index, future)
                    continue
                worker.pool.shutdown()
                if attempt < ATTEMPTS:
                    waiting.append((index, attempt + 1))
                else:
                    yield Outcome(index, None, ProcessLostError())
    finally:
        _end(idle, [worker for worker, _, _ in running.values()])


def _outcome(index: int, future: Future[Result]) -> Outcome[Result]:
    error = future.exception()
    if error is None:
        return Outcome(index, future.result())
    # Somebody ended this worker alone: as good as lost.
    return Outcome(index, None, error if isinstance(error, Exception) else ProcessLostError())


def _start() -> _Worker:
    pool = ProcessPoolExecutor(1, get_context("spawn"), _begin)
    with _environment(dict.fromkeys(THREADS, "1")):
        # The process is made by the first thing that it is given to do.
        pid = pool.submit(os.getpid).result()
    return _Worker(pool, pid)


def _end(idle: Sequence[_Worker], busy: Sequence[_Worker]) -> None:
    """Idle processes leave; busy ones drop what they do, clean up after it and leave."""
    for worker in (*idle, *busy):
        worker.pool.shutdown(wait=False, cancel_futures=True)
    _terminate([worker.pid for worker in busy])
    for worker in (*idle, *busy):
        worker.pool.shutdown()


def _terminate(pids: Sequence[int]) -> None:
    """Have processes stop what they do, and wait for it."""
    waiting = set(pids)
    for beat in count():
        for pid in tuple(waiting):
            try:
                # More than once: Python drops what a signal raises in a destructor.
                os.kill(pid, 0 if beat % _BEATS_A_SIGNAL else signal.SIGTERM)
            except ProcessLookupError:
                waiting.discard(pid)
        if not waiting:
            return
        time.sleep(_BEAT_S)


def _begin() -> None:
    """In a new process: be ended by its parent alone, and by its parent's end."""
    # Ctrl-C and a closed terminal reach all processes at once; the parent decides.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _stop)
    sys.unraisablehook = _tell_unless_stopped
    threading.Thread(target=_follow_parent, daemon=True).start()


def _stop(_number: int, _frame: FrameType | None) -> None:
    # No Exception, so that nothing that goes on after one bad pair or link goes on after this.
    sys.exit(128 + signal.SIGTERM)


def _tell_unless_stopped(dropped: sys.UnraisableHookArgs) -> None:
    """Tell of what was raised in a destructor; that the process was stopped there is no news."""
    if not issubclass(dropped.exc_type, SystemExit):
        sys.__unraisablehook__(dropped)


def _follow_parent() -> None:
    parent = parent_process()
    if parent is None:
        return
    parent.join()
    # More than once: what is interrupted may be the clearing up of a task, after which one waits again.
    while True:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1.0)


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
