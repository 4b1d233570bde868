"""An hour at full rate through decoders, recording loop and files: written whole, in constant memory."""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from slam_uwb.io import recorded_stations

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SWEEP_HZ, LES_HZ, CHUNK_S = 500, 10, 10


@pytest.mark.skipif(sys.platform != "linux", reason="memory in use now is asked of /proc")
def test_an_hour_is_recorded_in_constant_memory(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    script = import_module("long_recording")
    sizes, ended = script.record_long(tmp_path / "survey", "sweep", 60, script.resident_bytes)
    assert ended.problem is None
    assert len(sizes) == 60
    # Of 60 MB that were written since minute 6, as text; a number a sample alone would be 13 MB.
    assert max(sizes[6:]) - sizes[5] < 3_000_000
    # Time counts from the first chunk on.
    seconds = 3600 + CHUNK_S
    assert ended.live.scan.samples == seconds * SWEEP_HZ
    assert [a.count for a in ended.live.anchors] == [seconds * LES_HZ] * 4
    (station,) = recorded_stations(tmp_path / "survey").values()
    assert station.complete
    rows = np.loadtxt(tmp_path / "survey" / station.files[0], delimiter=",", skiprows=1)
    assert len(rows) == seconds * SWEEP_HZ
    assert np.ptp(rows[:, 2]) > 3600
    assert (np.diff(rows[:, 2]) >= 0).all()
