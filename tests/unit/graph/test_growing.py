"""Station by station the problem ends where it ends when it is solved at once."""

import gtsam
import numpy as np
import pytest

from slam_uwb.graph import factors
from slam_uwb.graph.growing import GrowingProblem
from slam_uwb.graph.incremental import solve_by_passes
from slam_uwb.graph.variables import Indices
from slam_uwb.model.errors import SolverError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement, ScanMatch
from slam_uwb.model.settings import GraphSettings, RangingSettings
from slam_uwb.model.survey import Anchor, RangeOffset, Station
from slam_uwb.ranging import link_model

SETTINGS = GraphSettings()
MODEL = link_model(RangingSettings())
PRIOR = RangeOffset(0.2, 0.1)
LEVER = (0.1, -0.05)
PLACES = {"A": (-1.0, -1.0), "B": (9.0, -0.5), "C": (8.5, 7.0), "D": (-0.5, 6.5)}
ANCHORS = tuple(Anchor(name, 2.5) for name in PLACES)


def survey(seed=5, count=12):
    """Stations on a lattice, each matched with the three before it; a third of the links long."""
    rng = np.random.default_rng(seed)
    poses = [
        Pose2(2.5 * (k % 4), 2.5 * (k // 4), rng.uniform(-3, 3)) if k else Pose2.identity()
        for k in range(count)
    ]
    stations = [Station(f"s{k:02d}", None, 1.4) for k in range(count)]
    matches, links = [[] for _ in poses], [[] for _ in poses]
    sigmas = np.array([0.01, 0.01, 0.003])
    for k, pose in enumerate(poses):
        for j in range(max(0, k - 3), k):
            found = poses[j].inverse() @ pose @ Pose2(*rng.normal(0.0, sigmas))
            ends = (stations[j].id, stations[k].id)
            matches[k].append(ScanMatch(*ends, found, np.diag(sigmas**2), 1.0, 0.0, 1.0, 0))
        for anchor, place in PLACES.items():
            tag = pose.transform(np.array(LEVER))
            error = 0.2 + rng.normal(0.0, 0.05) + rng.gamma(1.3, 0.3) * (rng.random() < 0.3)
            distance = float(np.hypot(np.hypot(*(np.array(place) - tag)), 1.1) + error)
            links[k].append(LinkMeasurement(stations[k].id, anchor, distance, distance, 0.1, 10))
    return stations, matches, links


def grow(stations, matches, links):
    problem = GrowingProblem(ANCHORS, MODEL, PRIOR, SETTINGS, LEVER)
    entered = [problem.add_station(*each) for each in zip(stations, matches, links, strict=True)]
    return problem, entered


@pytest.fixture(scope="module")
def grown():
    problem, entered = grow(*survey())
    problem.settle()
    return problem, entered


def at_once(problem, stations, matches):
    """The batch solution of the same matches and the same ranges with the same labels."""
    indices = Indices(
        {s.id: k for k, s in enumerate(stations)}, {a.id: k for k, a in enumerate(ANCHORS)}
    )
    fixed = gtsam.NonlinearFactorGraph()
    fixed.push_back(factors.gauge_factor(0, Pose2.identity()))
    fixed.push_back(factors.offset_prior(PRIOR))
    for k in range(len(ANCHORS)):
        fixed.push_back(factors.delay_prior(k, MODEL.anchor_sigma))
    for match in (m for each in matches for m in each):
        ends = (indices.stations[match.target], indices.stations[match.source])
        fixed.push_back(factors.match_factor(match, *ends))
    return solve_by_passes(fixed, problem.ranges, problem.variables, indices, SETTINGS).variables


def gap(one, other):
    poses = [pose.distance_to(other.poses[name]) for name, pose in one.poses.items()]
    anchors = [np.hypot(*(p - other.anchors[name])) for name, p in one.anchors.items()]
    return max([*poses, *anchors])


def test_station_by_station_ends_where_the_whole_problem_ends(grown):
    stations, matches, _ = survey()
    problem, _ = grown
    assert gap(problem.variables, at_once(problem, stations, matches)) < 1e-4


def test_before_it_settles_it_is_near(grown):
    problem, _ = grow(*survey())
    assert gap(problem.variables, grown[0].variables) < 0.02


def test_anchors_enter_once_their_place_is_told(grown):
    problem, entered = grown
    assert problem.variables.anchors.keys() == PLACES.keys()
    # The first four stations stand in line: nothing but a mirror image could be told.
    assert all(anchors == () for anchors in entered[:4])
    for name, place in PLACES.items():
        assert np.hypot(*(problem.variables.anchors[name] - place)) < 0.4


def test_the_order_of_the_links_of_a_station_changes_nothing(grown):
    stations, matches, links = survey()
    problem, _ = grow(stations, matches, [each[::-1] for each in links])
    problem.settle()
    assert gap(problem.variables, grown[0].variables) < 1e-5


def test_a_station_that_no_match_holds_is_refused(grown):
    problem, _ = grow(*survey(count=5))
    with pytest.raises(SolverError, match="no match holds station lost"):
        problem.add_station(Station("lost", None, 1.4), (), ())
