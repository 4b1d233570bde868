"""Decoders keep up with their devices by far."""

from importlib import import_module
from pathlib import Path

import pytest

from slam_uwb.capture.ports import LIDARS, TAGS

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.mark.parametrize("name", [*LIDARS, *TAGS])
def test_at_least_twenty_times_the_line_rate(monkeypatch, name):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    script = import_module("benchmark_capture")
    # In time of the processor: what else the machine does does not count.
    line, sound, noise = script.throughput(name, script.STREAMS[name])
    assert min(sound, noise) >= 20.0 * line
