"""Tasks on a Dask cluster that is there already; the only home of `distributed`.

Its workers see the same files under the same paths, and have this package installed. A task whose
worker ends is given to another one.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING, TypeVar

from ..model.errors import MissingLibraryError, SlamUwbError
from .outcome import Outcome, ProcessLostError

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

PATIENCE_S = 10.0
"""For the scheduler's answer, and for the first worker."""

_ONE_AT_A_TIME = threading.Lock()


class ClusterError(SlamUwbError):
    """The cluster cannot be reached, or has no workers."""

    def __init__(self, address: str, problem: str) -> None:
        super().__init__(f"--scheduler {address}: {problem}")


class ClusterLostError(ClusterError):
    """The scheduler went away."""

    exit_status = 1


def run_on_cluster(
    function: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Generator[Outcome[Result], None, None]:
    """Outcomes of all tasks as they come; closing the iterator takes back what was not begun.

    Args:
        function: importable by name on the workers. A task may be worked on again where its worker
            was lost, so it must not matter that it was.
        tasks: what travels to the workers.
        address: of the scheduler, ``tcp://host:port``.

    Raises:
        MissingLibraryError: `distributed` is not installed.
        ClusterError: no scheduler or no worker answers.
        ClusterLostError: the scheduler went away while there was work.
    """
    client = _connect(address)
    try:
        from distributed import as_completed

        futures = client.map(_alone, [function] * len(tasks), tasks, pure=False)
        index = {future.key: number for number, future in enumerate(futures)}
        try:
            for future in as_completed(futures, loop=client.loop):
                if future.cancelled():
                    raise ClusterLostError(
                        address, "the scheduler went away: run it again to go on"
                    )
                yield _outcome(index[future.key], future)
        finally:
            client.cancel(futures)
    finally:
        client.close()


def _connect(address: str) -> Client:
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingLibraryError(
            "--scheduler needs dask.distributed: pip install 'slam-uwb[batch]'"
        ) from error
    try:
        # First without a client: one that never connected complains again when it is dropped.
        asyncio.run(_reach(address))
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(address, f"no Dask scheduler answers there ({error})") from error
    try:
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except TimeoutError as error:
        client.close()
        raise ClusterError(address, "the cluster has no workers") from error
    return client


async def _reach(address: str) -> None:
    from distributed.comm import connect
    from distributed.security import Security

    security = Security().get_connection_args("client")
    comm = await connect(address, timeout=PATIENCE_S, **security)
    comm.abort()


def _alone(function: Callable[[Task], Result], task: Task) -> Result:
    """On a worker: one task at a time, also where it has several threads.

    Figures are not drawn in threads, and memory is planned by process.
    """
    with _ONE_AT_A_TIME:
        return function(task)


def _outcome(index: int, future: object) -> Outcome[Result]:
    from distributed import Future
    from distributed.scheduler import KilledWorker

    assert isinstance(future, Future)  # noqa: S101 - what as_completed is given it gives back
    error = future.exception()
    if error is None:
        return Outcome(index, future.result())
    return Outcome(index, None, ProcessLostError() if isinstance(error, KilledWorker) else error)
