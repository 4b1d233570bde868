"""What `make bench` measures with: memory of several processes, the two solvers' graph, the page."""

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
PARENT = """
import os, time
held = bytearray(60_000_000)
held[::4096] = b"x" * len(held[::4096])  # every page touched, none copied
pid = os.fork()
if pid == 0:
    time.sleep(1.0)
    os._exit(0)
os.waitpid(pid, 0)
"""


@pytest.fixture
def load(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module


@pytest.mark.skipif(sys.platform != "linux", reason="proportional set sizes are Linux's")
def test_memory_that_processes_share_is_counted_once(load):
    wall, peak = load("measure").run_measured([sys.executable, "-c", PARENT])
    assert wall >= 1.0
    # 60 MB held by two processes; the interpreters have about 10 MB each.
    assert 60 < peak < 100


def test_a_command_that_fails_is_told(load):
    with pytest.raises(RuntimeError, match="status 3"):
        load("measure").run_measured([sys.executable, "-c", "raise SystemExit(3)"])


def test_both_solvers_of_the_drawn_graph_agree(load):
    drawn = load("joint_graph").draw_graph(60, 5, 240)
    ours, _ = load("joint_graph").solve_ours(drawn)
    batch = load("joint_graph").solve_batch(drawn)
    assert load("joint_graph").gap_m(ours, batch) < 1e-4
    assert 0.05 < load("joint_graph").gap_m(drawn.start, drawn.truth) <= 0.2 + 1e-9


def test_passes_end_where_the_cost_has_nothing_more_to_say(load):
    """At a thousand stations steps stay above the tolerance for ever: rounding moves them."""
    _, passes = load("joint_graph").solve_ours(load("joint_graph").draw_graph(1000, 8, 6000))
    assert passes <= 30


def test_the_page_judges_by_the_limits(load, tmp_path):
    def bench(seconds, **info):
        return {"stats": {"median": seconds}, "extra_info": {"load": [0.5, 0.5, 0.5], **info}}

    whole = {"whole": True, "profile": [["graph: solve", 3, 0.5]]}
    run = {
        "datetime": "2020-01-02T03:04:05",
        "machine_info": {"cpu": {"brand_raw": "a processor", "count": 2}},
        "benchmarks": [
            bench(2.0, size=18, stations=10, stage="map"),
            # Four times the stations, eight times the time: 4^1.5.
            bench(16.0, size=90, stations=40, stage="map"),
            bench(0.5, size=18, stations=10, reference="map", what="half", share=0.5),
            bench(4.0, size=18, stations=10, peak_mb=400.0, **whole),
            bench(36.0, size=90, stations=40, peak_mb=3100.0, **whole),
            bench(9.0, program="batch", count=5, workers=2, single_s=10.0, peak_mb=1.0),
            bench(3.0, graph="ours", stations=300, anchors=1, links=2, matches=3, passes=4, gap_mm=0),
            bench(1.0, graph="batch", stations=300),
        ],
    }  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(run))
    command = [sys.executable, str(BENCHMARKS / "page.py"), "run.json", "page.md"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    lines = (tmp_path / "page.md").read_text().splitlines()
    rows = {line.split(" | ")[0].strip("| "): line for line in lines if line.startswith("|")}
    assert rows["map"] == "| map | 2.00 s | 16.00 s | 1.50 |"
    # Half of it was timed in half a second: a second for all.
    assert rows["10 stations: map"].endswith("| 1.000 s | 2.0 |")
    assert rows["10 stations, whole"].endswith("| 5 s | yes |")
    assert rows["40 stations, whole"].endswith("| 35 s | **no** |")
    assert rows["40 stations, peak memory (PSS)"].endswith("| 3000 MB | **no** |")
    assert rows["batch of 5 `flat`, 2 workers, to the sum of single solves"].endswith("| **no** |")
    assert "not judged" in rows["joint solve of 300 drawn stations, times GTSAM's batch"]
    assert rows["graph: solve"] == "| graph: solve | 3 | 50.0 % |"
