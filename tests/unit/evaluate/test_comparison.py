"""Methods side by side: every combination has its row, and a failure its reason."""

import csv
import io
import math
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from slam_uwb.evaluate import (
    MethodResult,
    compare_methods,
    comparison_to_csv,
    comparison_to_latex,
    comparison_to_markdown,
    methods,
)
from slam_uwb.evaluate.comparison import AS_PRINTED
from slam_uwb.model.survey import KnownPlace
from slam_uwb.simulate import Lidar, Radio, simulate_survey

SOLVED = MethodResult(
    "office_1", "joint, a, b", "joint", "a", "b", 18, 17, 0.0123, 7, 6, 0.25, 0.5, (0.1, 0.5), 1.2, 3.456
)  # fmt: skip
FAILED = MethodResult(
    "office_1", "sequential, a, b", "sequential", "a", "b", 18, 0, seconds=1.0,
    failure="it is 100 % | broken\nreally",
)  # fmt: skip


@pytest.fixture(scope="module")
def surveyed():
    """A flat whose tripod stood at surveyed places: no scans, so that a solve takes no time."""
    made = simulate_survey(
        "flat",
        3,
        lidar=Lidar.noise_free(duration=0.1, upper_duration=0.0),
        radio=Radio.noise_free(duration=2.0),
    )
    stations = tuple(
        replace(s, scan=None, known=KnownPlace(p.x, p.y, 0.001, p.theta))
        for s, p in zip(made.survey.stations, made.reference.stations.values(), strict=True)
    )
    return replace(made.survey, stations=stations, sequence=None), made.reference


def test_every_combination_is_a_method():
    names = [method.name for method in methods()]
    assert len(names) == len(set(names)) == 2 * 2 * 4 + 1
    assert names[-1] == AS_PRINTED
    paper = methods()[-1].settings
    assert (paper.graph.mode, paper.matching.pairs) == ("sequential", "sequence")
    assert (paper.matching.initialiser, paper.matching.refiner) == ("landmark", "paper_lm")
    few = methods(["joint"], ["landmark"], ["open3d"], as_printed=False)
    assert [method.name for method in few] == ["joint, landmark, open3d"]
    assert few[0].settings.matching.refiner == "open3d"


def test_each_method_has_its_row_and_its_time(surveyed):
    survey, reference = surveyed
    ticks, seen = count(0.0, 0.5), []
    compared = methods(initialisers=["correlative"], refiners=["point_to_line"], as_printed=False)
    rows = compare_methods(
        survey, reference, compared, lambda: next(ticks), lambda *told: seen.append(told)
    )
    assert [row.mode for row in rows] == ["joint", "sequential"]
    for row in rows:
        assert (row.failure, row.survey, row.seconds) == ("", survey.name, 0.5)
        assert (row.stations, row.stations_ok) == (10, 10)
        assert row.anchors == 5
        assert len(row.anchor_errors) == row.anchors_ok > 0
        # Exact ranges from places known to a millimetre.
        assert row.anchor_max < 0.2
        assert row.anchor_rmse == pytest.approx(np.sqrt(np.mean(np.square(row.anchor_errors))))
    assert seen == [(survey.name, k, 2) for k in (0, 1, 2)]


def test_without_a_reference_there_are_counts_and_no_errors(surveyed):
    survey, _ = surveyed
    (row,) = compare_methods(survey, None, methods()[:1], lambda: 0.0)
    assert row.stations_ok == 10
    assert math.isnan(row.anchor_rmse)
    assert row.anchor_errors == ()


def test_a_method_that_fails_has_its_reason(surveyed):
    # The paper as printed follows a sequence, and this survey has none.
    survey, reference = surveyed
    good, bad = compare_methods(survey, reference, [methods()[0], methods()[-1]], lambda: 0.0)
    assert good.failure == ""
    assert "sequence" in bad.failure
    assert bad.stations_ok == 0


def test_a_bug_of_a_method_costs_only_its_own_row(surveyed, monkeypatch):
    survey, reference = surveyed

    def broken(*_arguments, **_more):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("slam_uwb.pipeline.solve_survey", broken)
    (row,) = compare_methods(survey, reference, methods()[:1], lambda: 0.0)
    assert row.failure == "internal error: ZeroDivisionError: oops"


def test_csv_has_everything_and_nothing_made_up():
    first, second = csv.DictReader(io.StringIO(comparison_to_csv([SOLVED, FAILED])))
    assert (first["anchor_rmse_m"], first["anchors_ok"], first["seconds"]) == (
        "0.2500",
        "6",
        "3.46",
    )
    assert first["failure"] == ""
    assert (second["anchor_rmse_m"], second["anchor_nees_per_dof"]) == ("", "")
    assert second["failure"] == FAILED.failure


def test_markdown_keeps_its_columns():
    lines = comparison_to_markdown([SOLVED, FAILED]).splitlines()
    assert len(lines) == 4
    # A bar in a reason must not open a column.
    assert all(line.replace(r"\|", "").count("|") == 10 for line in lines)
    assert "17 of 18" in lines[2]
    assert "broken" in lines[3]
    assert "really" not in lines[3]


def test_latex_is_escaped_and_closed():
    text = comparison_to_latex([SOLVED, FAILED, replace(SOLVED, survey="b")])
    assert text.startswith(r"\begin{tabular}{llrrrrrrr}")
    assert text.endswith("\\end{tabular}\n")
    assert r"office\_1" in text
    assert r"100 \% | broken" in text
    # One rule below the head, one between the two surveys.
    assert text.count(r"\midrule") == 2
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    widths = {line.count("&") for line in rows if "multicolumn" not in line}
    assert widths == {8}
