"""Where signals strike while instruments run."""

from __future__ import annotations

import signal
import threading

import pytest

from slam_uwb.capture.signals import signals_held, signals_let_in, strike_now, unhurried


class StruckError(Exception):
    pass


def strike(number, _frame):
    # As the command line does: the second one would end the process.
    signal.signal(number, signal.SIG_DFL)
    raise StruckError


@pytest.fixture(autouse=True)
def handler():
    before = signal.signal(signal.SIGTERM, strike)
    yield strike
    assert signal.getsignal(signal.SIGTERM) in (strike, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, before)


def send():
    signal.raise_signal(signal.SIGTERM)


def test_a_held_signal_strikes_where_it_is_let():
    done = []
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        send()
        done.append("between")
        strike_now()
        done.append("never")
    assert done == ["between"]


def test_a_held_signal_strikes_at_the_end_at_the_latest():
    done = []
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        send()
        done.append("all")
    assert done == ["all"]


def test_while_a_motor_is_stopped_nothing_strikes():
    done = []
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        with unhurried():
            send()
            strike_now()
            with signals_let_in():
                done.append("stopped")
        # It arrived at the outer ones, which strike where they are let.
        done.append("after")
        strike_now()
        done.append("never")
    assert done == ["stopped", "after"]


def test_an_impatient_second_signal_does_not_come_between_the_first_and_the_stop():
    done = []
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        try:
            send()
            strike_now()
        finally:
            send()
            with unhurried():
                send()
                done.append("stopped")
    assert done == ["stopped"]


def test_signals_let_in_strike_at_once_and_are_held_again_after_it():
    done = []
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        try:
            with signals_let_in():
                send()
                done.append("never")
        finally:
            send()
            done.append("stopped")
    assert done == ["stopped"]


def test_what_arrived_before_strikes_when_signals_are_let_in():
    with pytest.raises(StruckError), signals_held():  # noqa: PT012
        send()
        with signals_let_in():
            raise AssertionError


def test_without_a_signal_nothing_happens(handler):
    with signals_held():
        strike_now()
        with signals_let_in(), unhurried():
            pass
    strike_now()
    assert signal.getsignal(signal.SIGTERM) is handler


def test_ignored_signals_stay_ignored():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with signals_held():
        send()
        strike_now()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    signal.signal(signal.SIGTERM, strike)


def test_other_threads_are_let_alone():
    done = []

    def work():
        with signals_held(), signals_let_in(), unhurried():
            strike_now()
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
