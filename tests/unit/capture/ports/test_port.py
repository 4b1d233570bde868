"""A port alone; what needs a device at its other end is tested over pseudo-terminals."""

from __future__ import annotations

import time
from types import SimpleNamespace

from slam_uwb.capture.clock import REAL_TIME
from slam_uwb.capture.ports import port as ports


def test_a_device_that_takes_nothing_holds_nobody_up(monkeypatch):
    monkeypatch.setattr(ports, "_SENT_S", 0.05)
    sent = []

    def flush():
        raise AssertionError("tcdrain has no time limit")

    line = SimpleNamespace(write=sent.append, flush=flush, out_waiting=5)
    begun = time.monotonic()
    ports.Port("port", line, REAL_TIME).write(b"DX\n")
    assert time.monotonic() - begun >= 0.05
    assert sent == [b"DX\n"]
