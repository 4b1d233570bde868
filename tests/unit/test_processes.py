"""Work shared out among processes: the same results in the same order, whatever becomes of the others."""

import importlib
import os
import sys
from functools import partial

import numpy as np
import pytest

from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.products import alone
from slam_uwb.processes import sharing

WORK = """
import os, signal, time
from slam_uwb.model.errors import SlamUwbError

def pid(_item):
    time.sleep(0.02)
    return os.getpid()

def refuse_three(item):
    time.sleep(0.01)
    if item == 3:
        raise SlamUwbError("no three")
    return item

def add(kept, item):
    return sum(kept.value) + item

def end_elsewhere(home, item):
    if os.getpid() != home:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.01)
    return item

class Counted(list):
    pickled = 0

    def __reduce__(self):
        Counted.pickled += 1
        return list, (list(self),)
"""
"""What processes import by name: those of the test runner cannot be found so."""


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    (folder / "work_to_share.py").write_text(WORK)
    sys.path.insert(0, str(folder))
    yield importlib.import_module("work_to_share")
    sys.path.remove(str(folder))
    del sys.modules["work_to_share"]


@pytest.fixture(scope="module")
def share(work):
    with sharing(2) as share:
        others_of(share, work)
        yield share


def others_of(share, work):
    """The other processes' ids, once they are there."""
    for _ in range(200):
        if others := set(share(work.pid, range(20))) - {os.getpid()}:
            return others
    raise AssertionError("the other process never came")


def test_one_process_shares_nothing_out(work):
    with sharing(1) as share:
        assert share is alone
    assert set(alone(work.pid, range(3))) == {os.getpid()}
    assert alone.keep(work).value is work


def test_results_come_in_the_order_of_the_items(share):
    assert list(share(abs, [-3, 2, -1, 0])) == [3, 2, 1, 0]
    assert list(share(abs, [])) == []


def test_both_processes_work(share, work):
    pids = list(share(work.pid, range(20)))
    # One from the front, the other from the back, each item once.
    here = pids.count(os.getpid())
    assert pids == [os.getpid()] * here + [pids[-1]] * (20 - here)
    assert 5 <= here <= 15


def test_what_is_kept_travels_once(share, work):
    value, other = work.Counted([1, 2, 3]), np.array([4, 5])
    for _ in range(3):
        assert list(share(partial(work.add, share.keep(value)), range(9))) == list(range(6, 15))
    assert work.Counted.pickled == 1
    assert list(share(partial(work.add, share.keep(other)), range(9))) == list(range(9, 18))
    assert list(share(partial(work.add, share.keep(value)), range(9))) == list(range(6, 15))


def test_an_error_reaches_whoever_asked_and_the_rest_is_left(share, work):
    with pytest.raises(SlamUwbError, match="no three"):
        list(share(work.refuse_three, range(6)))
    assert list(share(abs, [-1, -2])) == [1, 2]


def test_a_process_that_is_lost_costs_time_and_no_result(work):
    with sharing(2) as share:
        others_of(share, work)
        assert list(share(partial(work.end_elsewhere, os.getpid()), range(12))) == list(range(12))
        # Nobody else is left.
        assert set(share(work.pid, range(4))) == {os.getpid()}
        assert list(share(partial(work.add, share.keep([1])), [1])) == [2]


def test_nothing_is_left_running(work):
    with sharing(2) as share:
        (other,) = others_of(share, work)
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)
