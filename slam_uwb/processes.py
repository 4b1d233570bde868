"""Work on one survey shared out among processes of this machine.

Whoever asks does its part from the front while the others work from the back, one item at a time:
nobody waits for a process that is still starting.
"""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.util import Finalize
from threading import Lock
from typing import Any, TypeVar

from .model.products import Kept, Share, alone

Item = TypeVar("Item")
Result = TypeVar("Result")


@contextmanager
def sharing(workers: int, modules: Sequence[str] = ()) -> Iterator[Share]:
    """A way to share work out among processes, this one among them.

    Args:
        workers: processes in all; 1 shares nothing out.
        modules: of this package, what the others import before their first task.
    """
    if workers == 1:
        yield alone
        return
    # One executor a process: what all are to keep reaches each. Not forked: a process with threads,
    # as one that has solved is, may hang in its copy.
    begin = _begin, (tuple(modules),)
    pools = [ProcessPoolExecutor(1, get_context("spawn"), *begin) for _ in range(workers - 1)]
    try:
        yield _Processes(pools)
    finally:
        for pool in pools:
            pool.shutdown(cancel_futures=True)


class _Processes:
    """The `Share` of this process and some others."""

    def __init__(self, pools: Sequence[ProcessPoolExecutor]) -> None:
        self._pools = pools
        self._kept: list[Kept[Any]] = []
        for pool in pools:
            # Starts with its first task: now, while this process reads.
            pool.submit(int)

    def keep(self, value: Item) -> Kept[Item]:
        """The value, sent to every process once."""
        for kept in self._kept:
            if kept.value is value:
                return kept
        self._kept.append(_Everywhere(len(self._kept), value))
        for pool in self._pools:
            _submit(pool, _store, value)
        return self._kept[-1]

    def __call__(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[Result]:
        """The results in the order of the items, as they come; the others begin at once."""
        waiting, lock = deque(range(len(items))), Lock()
        elsewhere: dict[int, Future[Result]] = {}

        def hand_out(pool: ProcessPoolExecutor) -> None:
            with lock:
                # A process that is gone takes nothing more.
                begun = _submit(pool, function, items[waiting[-1]]) if waiting else None
                if begun is not None:
                    elsewhere[waiting.pop()] = begun
            # Outside of the lock: what is done already calls back at once.
            if begun is not None:
                begun.add_done_callback(lambda _: hand_out(pool))

        def gather() -> Iterator[Result]:
            try:
                for number, item in enumerate(items):
                    with lock:
                        here = bool(waiting)
                        if here:
                            waiting.popleft()
                    yield function(item) if here else _result(elsewhere[number], function, item)
            finally:
                with lock:
                    waiting.clear()

        for pool in self._pools:
            hand_out(pool)
        return gather()


class _Everywhere(Kept[Item]):
    """Travels as the number that every process has it under."""

    def __init__(self, number: int, value: Item) -> None:
        super().__init__(value)
        self.number = number

    def __reduce__(self) -> tuple[Callable[[int], Kept[Any]], tuple[int]]:
        return _look_up, (self.number,)


def _submit(
    pool: ProcessPoolExecutor, function: Callable[[Item], Result], item: Item
) -> Future[Result] | None:
    """None where the process is gone, or everything is being ended."""
    try:
        return pool.submit(function, item)
    except RuntimeError:
        return None


def _result(future: Future[Result], function: Callable[[Item], Result], item: Item) -> Result:
    """What another process found; found here, where that process is gone."""
    try:
        return future.result()
    except BrokenProcessPool:
        return function(item)


# What follows runs in the other processes.

_values: list[Any] = []
"""What they keep, in the order in which it was sent."""


def _begin(modules: Sequence[str]) -> None:
    """Be ready. A terminal's signals are for the process that was started there; it ends the others."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # Taking all down again that was imported takes longer than just ending.
    Finalize(None, os._exit, (0,), exitpriority=0)
    for module in modules:
        import_module(f"{__package__}.{module}")


def _store(value: object) -> None:
    _values.append(value)


def _look_up(number: int) -> Kept[Any]:
    return Kept(_values[number])
