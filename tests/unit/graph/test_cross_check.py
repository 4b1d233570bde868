"""Other ways to the solution find what the solver missed, and nothing where it missed nothing."""

from dataclasses import replace
from types import SimpleNamespace

import gtsam
import numpy as np
import pytest

from slam_uwb.graph import cross_check
from slam_uwb.graph.cross_check import batch_gap, check_optimum, other_starts_gap
from slam_uwb.graph.factors import delay_prior, known_station_factors, offset_prior
from slam_uwb.graph.incremental import solve_by_passes
from slam_uwb.graph.ranges import RangeTable, weigh_ranges
from slam_uwb.graph.variables import Indices, Variables
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import GraphSettings, RangingSettings
from slam_uwb.model.survey import KnownPlace, RangeOffset
from slam_uwb.ranging import link_model

SETTINGS = GraphSettings()
STATIONS = {"s1": Pose2(0.0, 0.0, 0.0), "s2": Pose2(6.0, 0.0, 0.0), "s3": Pose2(6.0, 5.0, 0.0)}
INDICES = Indices({"s1": 0, "s2": 1, "s3": 2}, {"A": 0})
TRUE, WRONG = np.array([2.0, 3.0]), np.array([2.15, 3.2])  # 0.25 m apart


@pytest.fixture(scope="module")
def optimum():
    """Three exact ranges from fixed stations to one anchor."""
    fixed = gtsam.NonlinearFactorGraph()
    for k, pose in enumerate(STATIONS.values()):
        for factor in known_station_factors(k, KnownPlace(pose.x, pose.y, 1e-3, pose.theta)):
            fixed.push_back(factor)
    fixed.push_back(offset_prior(RangeOffset(0.0, 1e-3)))
    fixed.push_back(delay_prior(0, 1e-3))
    measured = np.array([np.hypot(*(TRUE - pose.translation)) for pose in STATIONS.values()])
    table = RangeTable(
        tuple(STATIONS), ("A",), frozenset(), np.zeros((3, 2)), np.arange(3), np.full(3, 3),
        measured, np.full(3, 0.03), np.zeros(3),
    )  # fmt: skip
    model = link_model(RangingSettings()).cleared(1e-3)
    ranges = weigh_ranges(table, model.unlabelled(3), model)
    start = Variables(dict(STATIONS), {"A": np.array([2.2, 2.8])}, 0.0, {"A": 0.0})
    return solve_by_passes(fixed, ranges, start, INDICES, SETTINGS)


def stuck(optimum):
    """What a solver would return that stopped short of the optimum."""
    variables = replace(optimum.variables, anchors={"A": WRONG})
    return replace(optimum, variables=variables, cost=optimum.cost + 1.0)


def test_there_is_no_gap_at_the_optimum(optimum):
    np.testing.assert_allclose(optimum.variables.anchors["A"], TRUE, atol=1e-6)
    checks = check_optimum(optimum, INDICES, SETTINGS)
    # Not exactly nothing: the batch solver starts elsewhere and arrives by itself.
    assert 0.0 < checks.isam2_batch_gap < 1e-6
    assert checks.other_starts_gap == 0.0


def test_an_isam2_problem_that_is_elsewhere_is_told(optimum, monkeypatch):
    values = gtsam.Values(optimum.values)
    values.update(gtsam.symbol("l", 0), TRUE + [0.003, 0.004])
    elsewhere = SimpleNamespace(calculateEstimate=lambda: values)
    monkeypatch.setattr(cross_check, "incremental_problem", lambda _: elsewhere)

    assert batch_gap(optimum, INDICES) == pytest.approx(0.005, abs=1e-5)


def test_the_batch_solver_tells_how_far_a_solver_stopped_short(optimum):
    assert batch_gap(stuck(optimum), INDICES) == pytest.approx(0.25, abs=1e-3)


def test_a_better_optimum_is_found_from_other_starts(optimum):
    assert other_starts_gap(stuck(optimum), INDICES, SETTINGS) == pytest.approx(0.25, abs=1e-3)


def test_a_worse_one_is_no_gap(optimum):
    best = replace(optimum, cost=optimum.cost - 1.0)
    assert other_starts_gap(best, INDICES, SETTINGS) == 0.0
