"""Tasks in processes: order, failures, lost processes, threads, interruption.

The functions are those of the standard library: a new process imports them by name.
"""

import math
import os
import signal
import time
from contextlib import closing

import pytest

from slam_uwb.batch import map_tasks, run_tasks
from slam_uwb.batch.outcome import ProcessLostError
from slam_uwb.batch.processes import THREADS


@pytest.mark.parametrize("workers", [1, 3])
def test_results_are_in_the_order_of_the_tasks(workers):
    # The first ends last.
    assert map_tasks(math.sqrt, [4.0, 9.0, 16.0], workers) == [2.0, 3.0, 4.0]
    assert map_tasks(time.sleep, [0.5, 0.0], workers) == [None, None]


def test_outcomes_come_as_they_are_done():
    with closing(run_tasks(time.sleep, [1.5, 0.0], 2)) as outcomes:
        assert [outcome.index for outcome in outcomes] == [1, 0]


def test_progress_counts_what_is_done():
    told = []
    map_tasks(math.sqrt, [1.0, 4.0], 1, lambda done, total: told.append((done, total)))
    assert told == [(1, 2), (2, 2)]


def test_a_failing_task_stops_no_other():
    outcomes = sorted(run_tasks(math.sqrt, [1.0, -1.0, 4.0], 1), key=lambda o: o.index)
    assert [o.result for o in outcomes] == [1.0, None, 2.0]
    assert isinstance(outcomes[1].error, ValueError)
    with pytest.raises(ValueError, match=r"math domain|nonnegative"):
        map_tasks(math.sqrt, [-1.0], 1)


@pytest.mark.parametrize("function", [os._exit, signal.raise_signal])
def test_a_lost_process_is_named_and_stops_no_other(function):
    # os._exit(9); raise_signal(SIGKILL = 9): as the kernel does where memory ends.
    outcomes = list(run_tasks(function, [9, 9], 2))
    assert sorted(o.index for o in outcomes) == [0, 1]
    assert all(isinstance(o.error, ProcessLostError) for o in outcomes)


def test_others_go_on_beside_a_lost_process():
    # Signal 0 is none at all.
    errors = {o.index: o.error for o in run_tasks(signal.raise_signal, [9, 0, 0], 1)}
    assert isinstance(errors.pop(0), ProcessLostError)
    assert errors == {1: None, 2: None}


def test_linear_algebra_has_one_thread_in_each_process():
    before = {name: os.environ.get(name) for name in THREADS}
    assert map_tasks(os.getenv, THREADS, 2) == ["1"] * len(THREADS)
    assert {name: os.environ.get(name) for name in THREADS} == before


def test_closing_ends_busy_processes_at_once():
    start = time.monotonic()
    with closing(run_tasks(time.sleep, [0.0, 60.0, 60.0], 2)) as outcomes:
        assert next(outcomes).index == 0
    assert time.monotonic() - start < 30.0


def test_no_tasks_no_processes():
    assert map_tasks(math.sqrt, [], 2) == []
