"""The scripts of the paper's tables and figures: what needs no minute of solving."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from slam_uwb import solve_survey
from slam_uwb.model.solution import Status
from slam_uwb.simulate import Lidar, simulate_survey

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
LIGHT = 299_792_458.0


@pytest.fixture
def paper(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    modules = ("eq_ranging", "experiment", "fig4", "page", "run")
    return SimpleNamespace(**{name: import_module(f"paper.{name}") for name in modules})


@pytest.fixture
def run(paper, tmp_path):
    return paper.run.Run(tmp_path, range(2), quick=True, workers=1, code="abc")


def test_biases_are_those_of_the_equations(paper):
    # Single-sided: the reply of 300 us, timed by clocks 20 ppm apart: c * 300e-6 * 20e-6 / 2 = 0.90 m. Eq. 3 for
    # replies 10 us apart and clocks of +10 and -10 ppm: c * 10e-6 * 20e-6 / 4 = 15 mm, whatever its sign.
    single, symmetric, asymmetric = paper.eq_ranging.biases(10.0, 0.0)
    assert abs(single) == pytest.approx(LIGHT * 300e-6 * 20e-6 / 2, rel=1e-3)
    assert symmetric == pytest.approx(0.0, abs=1e-6)
    assert asymmetric == pytest.approx(0.0, abs=1e-6)
    apart = paper.eq_ranging.biases(10.0, 10e-6)
    assert abs(apart[1]) == pytest.approx(LIGHT * 10e-6 * 20e-6 / 4, rel=1e-3)


def test_a_section_is_made_and_its_claims_hold(paper, run):
    section = paper.eq_ranging.make(run)
    assert (run.out / "eq1-3.png").read_bytes().startswith(b"\x89PNG")
    assert all(claim.holds for claim in section.claims)
    text = paper.page.page(run, [section], "make reproduce", "2020-01-01")
    assert "quick run" in text
    assert "not public" in text
    assert "(eq1-3.png)" in text


def test_the_match_shown_is_that_of_algorithm_4(paper, run):
    section = paper.fig4.make(run)
    assert (run.out / "fig4.png").exists()
    assert section.claims[0].holds


def test_what_was_done_is_not_done_again(run):
    first = run.each("roots", math.sqrt, [4.0, 9.0])
    assert first == [2.0, 3.0]
    store = run.out / "cache" / "abc" / "roots.jsonl"
    lines = store.read_text().splitlines()
    # An interruption tore the last line; what stands there already is taken as it is.
    torn = json.loads(lines[0]) | {"result": 7.0}
    other = json.loads(lines[1])
    store.write_text(json.dumps(torn) + "\n" + lines[1][:10])
    again = run.each("roots", math.sqrt, [4.0, 9.0])
    assert sorted(again) == sorted([7.0, other["result"]])


def test_what_is_not_known_is_null_and_left_out_of_medians(paper, run):
    assert run.each("logs", math.fabs, [1.0]) == [1.0]
    assert run.interval([0.1, None, 0.3]).count == 2
    assert paper.run.shown(run.interval([])) == "none"
    assert paper.run.shown(run.interval([np.nan, 0.25])) == "0.25 m"


def test_errors_of_anchors_that_nothing_aligns_are_not_known(paper):
    """Of the paper as printed one station may be left: ok, as its anchors are, and no frame to compare in."""
    made = simulate_survey("flat", 2, lidar=Lidar(duration=2.0, upper_duration=0.0))
    solution = solve_survey(made.survey)
    known = paper.experiment.scores(made, solution)["errors"]
    assert known
    assert all(map(math.isfinite, known.values()))
    first, *others = solution.stations
    alone = (
        first,
        *(replace(s, status=Status.DISCONNECTED, pose=None, covariance=None) for s in others),
    )
    scores = paper.experiment.scores(made, replace(solution, stations=alone))
    assert scores["stations_ok"] == 1
    assert scores["errors"] == {}


def test_tables_over_seeds_do_not_depend_on_the_number_of_processes(tmp_path):
    def table(script, *arguments):
        done = subprocess.run(
            [sys.executable, str(SCRIPTS / script), *arguments],
            capture_output=True, text=True, timeout=300, check=True, cwd=tmp_path,
        )  # fmt: skip
        return [line for line in done.stdout.splitlines() if line.startswith("|")]

    small = ("match_consistency.py", "flat:0:2", "--runs", "2", "--workers")
    one, two = (table(*small, workers) for workers in ("1", "2"))
    assert len(one) == 2 + 12 + 1
    assert one == two
