"""Every initialiser and refiner against one simulated truth with one tolerance."""

import math
from itertools import product

import numpy as np
import pytest

from slam_uwb.matching import INITIALISERS, REFINERS, Refinement, index_scans, match_pair
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MatchingSettings, ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays

WITHIN_M, WITHIN_RAD = 0.05, math.radians(1.0)
SETTINGS = MatchingSettings()
# An L-shaped room, seen from two places: nowhere else do the scans fit.
CORNERS = np.array([(0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)], dtype=float)
WALLS = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)
A, B = Pose2(2.6, 2.1, 0.5), Pose2(3.2, 1.6, -2.0)
TRUTH = A.inverse() @ B


def cast(walls, pose, noise, seed, max_range=40.0):
    bearings = np.radians(np.arange(-180, 180) + 0.5)
    ranges = cast_rays(pose.translation, bearings + pose.theta, np.asarray(walls, dtype=float))
    ranges = ranges + np.random.default_rng(seed).normal(0.0, noise, 360)
    return Scan(bearings, np.where(ranges <= max_range, ranges, np.nan), max_range)


def indexed(scans):
    prepared = {name: prepare_scan(name, scan, ScanSettings()) for name, scan in scans.items()}
    return index_scans(prepared, SETTINGS)


def is_true(pose):
    return pose.distance_to(TRUTH) < WITHIN_M and pose.angle_to(TRUTH) < WITHIN_RAD


@pytest.fixture(scope="module", params=[0.0, 0.005], ids=["exact", "5 mm of noise"])
def room(request):
    return indexed({"a": cast(WALLS, A, request.param, 1), "b": cast(WALLS, B, request.param, 2)})


@pytest.fixture(scope="module")
def odd_scans():
    """What may come from a site: hardly anything, one wall, no wall, everything far away, a room."""
    ahead = np.radians(np.arange(-20.0, 21.0))
    round_about = np.radians(np.arange(-180.0, 180.0, 10.0) + 0.5)
    scattered = np.random.default_rng(0).uniform(1.0, 9.0, 36)
    return indexed(
        {
            "three points": Scan([0.1, 1.0, 2.0], [2.0, 3.0, 4.0], 40.0),
            "one wall": Scan(ahead, 2.0 / np.cos(ahead), 40.0),
            "scattered": Scan(round_about, scattered, 40.0),
            "far": Scan(round_about, np.full(36, 39.0), 40.0),
            "room": cast(WALLS, A, 0.005, 3),
            "elsewhere": cast(WALLS + np.array([30.0, 0.0]), Pose2(33.0, 1.0, 0.2), 0.005, 4, 1.5),
        }
    )


@pytest.fixture(params=REFINERS)
def refiner(request, need_refiner):
    """Every refiner by name; those of libraries that are absent are skipped by name."""
    return need_refiner(request.param)


@pytest.mark.parametrize("name", INITIALISERS)
def test_initialisers_bring_the_truth_within_reach_of_the_refiners(room, name):
    starts = INITIALISERS[name](room["a"], room["b"], SETTINGS)
    assert starts.ndim == 2
    assert starts.shape[1] == 3
    assert len(starts) <= SETTINGS.initial_matches
    poses = [Pose2.from_vector(start) for start in starts]
    assert any(p.distance_to(TRUTH) < 0.3 and p.angle_to(TRUTH) < 0.09 for p in poses)


@pytest.mark.parametrize("step", [(0.1, 0.1, 0.08), (-0.15, 0.05, -0.08), (0.0, -0.15, 0.05)])
def test_refiners_reach_the_truth(room, refiner, step):
    start = (TRUTH @ Pose2(*step)).vector[None]
    refined = REFINERS[refiner](room["a"], room["b"], start, SETTINGS)
    assert refined.poses.shape == (1, 3)
    assert refined.converged.tolist() == [True]
    assert is_true(Pose2.from_vector(refined.poses[0]))


def test_refiners_leave_their_starts_alone(room, refiner):
    start = (TRUTH @ Pose2(0.1, 0.1, 0.08)).vector[None]
    before = start.copy()
    refined = REFINERS[refiner](room["a"], room["b"], start, SETTINGS)
    np.testing.assert_array_equal(start, before)
    assert not np.shares_memory(refined.poses, start)


@pytest.mark.parametrize("initialiser", INITIALISERS)
@pytest.mark.parametrize("ranking", ["evidence", "closest_points"])
def test_any_combination_matches_a_pair(room, initialiser, refiner, ranking):
    settings = SETTINGS.model_copy(
        update={"initialiser": initialiser, "refiner": refiner, "ranking": ranking}
    )
    best = match_pair(room["a"], room["b"], settings)[0]
    assert is_true(best.target_T_source)
    assert best.rank == 0
    assert best.violation < 0.01


@pytest.mark.parametrize("name", INITIALISERS)
@pytest.mark.parametrize("kind", ["twice", "backwards"])
def test_initialisers_repeat_themselves(room, name, kind):
    once = INITIALISERS[name](room["a"], room["b"], SETTINGS)
    if kind == "backwards":
        INITIALISERS[name](room["b"], room["a"], SETTINGS)
    np.testing.assert_array_equal(INITIALISERS[name](room["a"], room["b"], SETTINGS), once)


@pytest.mark.parametrize("initialiser", INITIALISERS)
@pytest.mark.parametrize("ranking", ["evidence", "closest_points"])
def test_odd_scans_raise_nothing_and_give_numbers(odd_scans, initialiser, refiner, ranking):
    settings = SETTINGS.model_copy(
        update={"initialiser": initialiser, "refiner": refiner, "ranking": ranking}
    )
    for target, source in product(odd_scans.values(), repeat=2):
        for match in match_pair(target, source, settings):
            numbers = [*match.target_T_source.vector, *match.covariance.ravel(), match.score]
            assert np.isfinite(numbers).all()
            assert 0.0 <= match.overlap <= 1.0
            assert 0.0 <= match.violation <= 1.0
            assert np.linalg.eigvalsh(match.covariance).min() > 0.0


def test_scans_without_overlap_are_no_reason_to_move(odd_scans, refiner):
    away = np.array([[70.0, 0.0, 1.0]])
    poses = REFINERS[refiner](odd_scans["room"], odd_scans["elsewhere"], away, SETTINGS).poses
    np.testing.assert_allclose(poses, away)


def converged_without_overlap(refine, target, source):
    """(6,) what a refiner says of three starts far beyond the walls, one at a time and all at once."""
    starts = np.array([[70.0, 0.0, 1.0], [-30.0, 5.0, -3.0], [0.0, 25.0, 0.0]])
    return np.concatenate(
        [
            refine(target, source, initial, SETTINGS).converged
            for initial in (*starts[:, None], starts)
        ]
    )


@pytest.mark.parametrize("source", ["room", "elsewhere", "three points"])
def test_the_start_is_not_returned_as_a_success(odd_scans, refiner, source):
    converged = converged_without_overlap(REFINERS[refiner], odd_scans["room"], odd_scans[source])
    assert not converged.any()


def test_a_refiner_that_returns_its_start_as_a_success_would_be_seen(room):
    def idle(_target, _source, initial, _settings):
        return Refinement(initial, np.ones(len(initial), dtype=bool), None)

    assert converged_without_overlap(idle, room["a"], room["b"]).tolist() == [True] * 6


def test_refiners_tell_how_many_steps_they_took_where_they_know(room, refiner):
    start = (TRUTH @ Pose2(0.1, 0.1, 0.08)).vector[None]
    iterations = REFINERS[refiner](room["a"], room["b"], start, SETTINGS).iterations
    # The two libraries do not say.
    assert (iterations is None) == (refiner in ("open3d", "kiss_icp"))
    assert iterations is None or (1 < iterations[0] < 100)


def test_refiners_repeat_themselves(room, refiner):
    starts = np.stack([(TRUTH @ Pose2(0.1, y, 0.05)).vector for y in np.linspace(-0.1, 0.1, 5)])
    once = REFINERS[refiner](room["a"], room["b"], starts, SETTINGS)
    for _ in range(10):
        again = REFINERS[refiner](room["a"], room["b"], starts, SETTINGS)
        np.testing.assert_array_equal(again.poses, once.poses)
        np.testing.assert_array_equal(again.converged, once.converged)
