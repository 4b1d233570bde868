"""Laws that every solver keeps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slam_uwb.graph import SOLVERS
from slam_uwb.model.errors import DisconnectedSurveyError, SolverError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import WallPieces
from slam_uwb.model.settings import GraphSettings, RangingSettings
from slam_uwb.model.solution import Status
from slam_uwb.model.survey import KnownPlace, RangeOffset
from slam_uwb.ranging import link_model

SETTINGS = GraphSettings()
INDEPENDENT = GraphSettings(pose_inflation=1.0)
"""For matches whose errors are drawn one by one; those of real scans share what a scan got wrong."""
MODES = sorted(SOLVERS)


# A real line of sight has reflections: its density leans to long ranges, its peak lies 1.5 mm beyond
# zero, and so much is what the joint solver makes of ranges without any error.
EXACT_TO = {"sequential": 1e-6, "joint": 2e-3}


@pytest.fixture(params=MODES)
def mode(request):
    return request.param


@pytest.fixture
def solve(mode):
    return lambda problem: SOLVERS[mode](problem, SETTINGS)


def known(scene, *names) -> dict[str, KnownPlace]:
    return {name: KnownPlace(*scene.stations[name].translation) for name in names}


def known_anchors(scene, *names) -> dict[str, KnownPlace]:
    return {name: KnownPlace(*scene.anchors[name][:2]) for name in names}


def statuses(estimate) -> dict[str, Status]:
    return {item.id: item.status for item in (*estimate.stations, *estimate.anchors)}


def disturbed(problem, rng, sigma=0.05):
    """The same problem started from a poor placement."""
    errors = {name: sigma * rng.standard_normal(3) for name in problem.placement}
    placement = {n: pose @ Pose2(*errors[n]) for n, pose in problem.placement.items()}
    return replace(problem, placement=placement)


# --- exact without noise -------------------------------------------------------------------------

EXACT = {
    "plain": lambda s: {},
    "lever arm": lambda s: {"lever": (0.12, -0.2)},
    "own tag height": lambda s: {"tag_heights": {"s03": 2.0, "s07": 0.9}},
    "stated offset": lambda s: {"range_offset": RangeOffset(0.3, 0.05), "true_offset": 0.3},
    "sequence": lambda s: {"sequence": (("s01", "s02"), ("s02", "s03"), ("s04", "s03"))},
    "anchor ranges": lambda s: {"anchor_pairs": (("A1", "A2"), ("A3", "A1"))},
    "no ranges": lambda s: {"anchors": {}},
    "site by two stations": lambda s: {"known_stations": known(s, "s01", "s05")},
    "site by one yaw": lambda s: {
        "known_stations": {"s04": KnownPlace(*s.stations["s04"].vector[:2], 0.02, 3.0)}
    },
    "site by two anchors": lambda s: {"known_anchors": known_anchors(s, "A1", "A3")},
    "site by station and anchor": lambda s: {
        "known_anchors": known_anchors(s, "A1"),
        "known_stations": known(s, "s05"),
    },
    "two stations without scan": lambda s: {"no_scan": {"s03", "s11"}},
    "all stations known, no scans": lambda s: {
        "known_stations": known(s, *s.stations),
        "no_scan": set(s.stations),
        "lever": (0.0, 0.0),
    },
    "only anchors known, no scans": lambda s: {
        "known_anchors": known_anchors(s, *s.anchors),
        "no_scan": set(s.stations),
    },
    "group tied to known stations without scan": lambda s: {
        "known_stations": known(s, "s01", "s02"),
        "no_scan": {"s01", "s02"},
    },
}


@pytest.mark.parametrize("case", sorted(EXACT))
def test_a_noise_free_problem_is_solved_exactly(scene, mode, solve, case):
    scene = scene.changed(**EXACT[case](scene))
    rng = np.random.default_rng(1)

    estimate = solve(disturbed(scene.problem(), rng, sigma=0.02))

    errors = scene.errors(estimate)
    # Everything is placed but headings that nothing measures.
    assert sum("heading" not in name for name in errors) == len(scene.stations) + len(scene.anchors)
    assert max(errors.values()) < EXACT_TO[mode], errors
    assert {item.status for item in (*estimate.stations, *estimate.anchors)} <= {
        Status.OK, Status.WEAK_GEOMETRY,
    }  # fmt: skip
    assert estimate.frame == ("site" if "known_" in str(EXACT[case](scene)) else "s01")


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**32 - 1))
def test_any_noise_free_survey_is_solved_exactly(scene, mode, seed):
    rng = np.random.default_rng(seed)
    # Stations a metre and a half apart at least, so that no two share a place.
    spots = [(x, y) for x in (1.0, 4.0, 7.0) for y in (1.0, 4.0, 7.0)]
    stations = {
        f"s{k}": Pose2(x + rng.uniform(-0.7, 0.7), y + rng.uniform(-0.7, 0.7), rng.uniform(-3, 3))
        for k, (x, y) in enumerate(spots)
    }
    anchors = {f"A{k}": (*rng.uniform(-2, 10, 2), rng.uniform(0.2, 4.0)) for k in range(4)}
    scene = scene.changed(
        stations=stations, anchors=anchors, max_pair=5.5, lever=tuple(rng.uniform(-0.3, 0.3, 2))
    )

    estimate = SOLVERS[mode](scene.problem(), SETTINGS)

    assert max(scene.errors(estimate).values()) < EXACT_TO[mode]
    assert all(anchor.position is not None for anchor in estimate.anchors)


# --- what the frame, the order and the place of the survey may change ------------------------------


def noisy(scene, **changes):
    rng = np.random.default_rng(7)
    pairs = [(s, a) for s in scene.stations for a in scene.anchors]
    walls = {pair: float(rng.gamma(1.3, 0.5)) for pair in pairs if rng.random() < 0.4}
    return scene.changed(match_noise=1.0, range_noise=0.05, long_ranges=walls, **changes)


def places(estimate) -> dict[str, np.ndarray]:
    found = {s.id: s.pose.vector for s in estimate.stations if s.pose is not None}
    return found | {a.id: a.position for a in estimate.anchors if a.position is not None}


def test_two_runs_give_identical_numbers(scene, solve):
    problem = noisy(scene).problem()

    first, second = solve(problem), solve(problem)

    for name, place in places(first).items():
        assert np.array_equal(place, places(second)[name])
    assert np.array_equal(first.joint_covariance, second.joint_covariance)
    assert [link.residual for link in first.links] == [link.residual for link in second.links]


@pytest.mark.parametrize("site", [False, True])
def test_the_order_of_the_survey_changes_nothing(scene, solve, site):
    scene = noisy(scene, no_scan={"s06"}, known_stations=known(scene, "s02", "s09") if site else {})
    problem = scene.problem()
    rng = np.random.default_rng(3)

    def shuffled(items, first=0):
        return tuple(items[:first]) + tuple(
            items[first + k] for k in rng.permutation(len(items) - first)
        )

    # Without a site the first station is the frame and has to stay the first.
    stations = shuffled(problem.stations, first=0 if site else 1)
    other = solve(
        replace(
            problem,
            stations=stations,
            anchors=shuffled(problem.anchors),
            matches=shuffled(problem.matches),
            links=shuffled(problem.links),
            placement={
                s.id: problem.placement[s.id] for s in stations if s.id in problem.placement
            },
        )
    )

    estimate = solve(problem)
    assert statuses(estimate) == statuses(other)
    assert places(estimate).keys() == places(other).keys()
    for name, place in places(estimate).items():
        np.testing.assert_allclose(places(other)[name], place, atol=1e-6, err_msg=name)


def test_moving_the_site_moves_the_solution(scene, solve):
    scene = noisy(scene, known_stations=known(scene, "s02", "s09"))
    moved_T_site = Pose2(-31.0, 17.0, 2.2)
    moved = scene.changed(
        stations={n: moved_T_site @ pose for n, pose in scene.stations.items()},
        anchors={n: (*moved_T_site.transform(p[:2]), p[2]) for n, p in scene.anchors.items()},
    )
    moved = moved.changed(known_stations=known(moved, "s02", "s09"))

    here, there = places(solve(scene.problem())), places(solve(moved.problem()))

    assert here.keys() == there.keys()
    for name, place in here.items():
        expected = moved_T_site.transform(place[:2])
        np.testing.assert_allclose(there[name][:2], expected, atol=1e-6, err_msg=name)


# --- what cannot be told is not told --------------------------------------------------------------


def test_an_anchor_heard_from_two_stations_is_unreachable(scene, solve):
    deaf = {(name, "A2") for name in list(scene.stations)[2:]}

    estimate = solve(scene.changed(deaf=deaf).problem())

    anchor = {a.id: a for a in estimate.anchors}["A2"]
    assert (anchor.status, anchor.position, anchor.covariance) == (Status.UNREACHABLE, None, None)
    reasons = {link.rejection for link in estimate.links if link.anchor == "A2"}
    assert reasons == {"the anchor is unreachable"}
    assert statuses(estimate)["A1"] is Status.OK


def test_stations_in_line_leave_two_places_and_none_is_chosen(scene, solve):
    line = {f"s{k}": Pose2(1.4 * k, 0.0, 0.3 * k) for k in range(8)}
    scene = scene.changed(stations=line, anchors={"A": (4.0, 5.0, 2.5)})

    (anchor,) = solve(scene.problem()).anchors

    assert (anchor.status, anchor.position) == (Status.MIRROR_AMBIGUOUS, None)
    found = sorted((other.x, other.y) for other in anchor.alternatives)
    np.testing.assert_allclose(found, [(4.0, -5.0), (4.0, 5.0)], atol=2e-2)
    assert sum(other.weight for other in anchor.alternatives) == pytest.approx(1.0)
    assert anchor.alternatives[0].weight == pytest.approx(0.5, abs=1e-3)


def test_an_anchor_without_height_is_weak_and_its_place_right(scene, solve):
    estimate = solve(scene.changed(unmeasured={"A2"}, tag_heights={"s05": 2.2}).problem())

    anchor = {a.id: a for a in estimate.anchors}["A2"]
    assert anchor.status is Status.WEAK_GEOMETRY
    # Its true height, 2.4 m, lies between two heights that are tried.
    assert anchor.height == pytest.approx(2.4, abs=0.15)
    assert scene.errors(estimate)["A2"] < 0.05
    measured = {a.id: a for a in solve(scene.problem()).anchors}["A2"]
    assert np.trace(anchor.covariance) > np.trace(measured.covariance)


def test_a_station_that_nothing_holds_is_disconnected(scene, solve):
    far = Pose2(40.0, 0.0, 0.0)
    scene = scene.changed(stations={**scene.stations, "lost": far})
    problem = scene.problem()
    placement = {n: pose for n, pose in problem.placement.items() if n != "lost"}

    estimate = solve(replace(problem, placement=placement))

    lost = {s.id: s for s in estimate.stations}["lost"]
    assert (lost.status, lost.pose, lost.covariance) == (Status.DISCONNECTED, None, None)
    reasons = {link.rejection for link in estimate.links if link.station == "lost"}
    assert reasons == {"the station is not placed"}
    assert "lost" not in estimate.joint_names


def test_the_larger_of_two_groups_is_solved(scene, solve):
    # Two clusters far apart that no match connects, both in the placement.
    small = {"a1": Pose2(50.0, 0.0, 0.0), "a2": Pose2(51.0, 1.0, 0.5)}
    scene = scene.changed(stations={**small, **scene.stations})

    estimate = solve(scene.problem())

    assert estimate.frame == "s01"
    assert statuses(estimate)["a1"] is statuses(estimate)["a2"] is Status.DISCONNECTED


def test_nothing_that_holds_together_is_an_error(scene, solve):
    with pytest.raises(DisconnectedSurveyError, match="no two stations hold together"):
        solve(scene.changed(no_scan=set(scene.stations)).problem())


def test_one_known_station_without_yaw_is_no_site(scene, solve):
    estimate = solve(scene.changed(known_stations=known(scene, "s04")).problem())

    assert estimate.frame == "s01"


def test_a_station_found_by_its_ranges_has_no_heading_and_the_lever_is_uncertainty(scene, solve):
    # 0.3 m from the centre in an unknown direction: 0.3^2 / 2 more on each axis.
    plain, levered = (
        {s.id: s for s in solve(scene.changed(no_scan={"s11"}, lever=lever).problem()).stations}
        for lever in ((0.0, 0.0), (0.3, 0.0))
    )

    assert not plain["s11"].heading_known
    assert plain["s11"].pose.theta == 0.0
    assert plain["s10"].heading_known
    widened = np.diag(levered["s11"].covariance) - np.diag(plain["s11"].covariance)
    assert widened[:2] == pytest.approx([0.045, 0.045], rel=0.15)


def test_a_located_station_between_two_places_is_not_placed(scene, solve):
    # Anchors in line see the lost tag on either side.
    anchors = {f"A{k}": (2.0 * k, 6.0, 2.5) for k in range(6)}
    scene = scene.changed(anchors=anchors, no_scan={"s11"})

    lost = {s.id: s for s in solve(scene.problem()).stations}["s11"]

    assert (lost.status, lost.pose) == (Status.MIRROR_AMBIGUOUS, None)
    assert len(lost.alternatives) == 2


def test_anchors_without_height_locate_no_lost_station(scene, solve):
    scene = scene.changed(no_scan={"s11"}, unmeasured=set(scene.anchors))

    assert statuses(solve(scene.problem()))["s11"] is Status.DISCONNECTED


def test_ranges_without_a_tag_height_are_not_used(scene, solve):
    problem = scene.problem()
    stations = tuple(replace(station, tag_height=math.nan) for station in problem.stations)

    estimate = solve(replace(problem, stations=stations))

    assert {link.rejection for link in estimate.links} == {"the height of the tag is not known"}
    assert {a.status for a in estimate.anchors} == {Status.UNREACHABLE}
    assert {s.status for s in estimate.stations} == {Status.OK}


def test_rejected_links_keep_their_reason_and_do_not_move_the_anchor(scene, mode, solve):
    problem = scene.changed(long_ranges={("s02", "A1"): 4.0}).problem()
    links = tuple(
        replace(k, rejection="dropped by hand") if (k.station, k.anchor) == ("s02", "A1") else k
        for k in problem.links
    )

    estimate = solve(replace(problem, links=links))

    assert max(scene.errors(estimate).values()) < EXACT_TO[mode]
    (link,) = (k for k in estimate.links if k.rejection is not None)
    assert link.rejection == "dropped by hand"
    assert link.residual == pytest.approx(4.0, abs=EXACT_TO[mode])
    assert {a.id: a.stations for a in estimate.anchors}["A1"] == len(scene.stations) - 1


# --- numbers that come with the answer ------------------------------------------------------------


def test_every_station_anchor_and_link_has_its_entry(scene, solve):
    scene = noisy(scene, no_scan={"s06"})
    problem = scene.problem()

    estimate = solve(problem)

    assert [s.id for s in estimate.stations] == list(scene.stations)
    assert [a.id for a in estimate.anchors] == list(scene.anchors)
    assert [(k.station, k.anchor) for k in estimate.links] == [
        (k.station, k.anchor) for k in problem.links
    ]
    assert [k.distance for k in estimate.links] == [k.distance for k in problem.links]


def test_the_joint_covariance_holds_the_single_ones(scene, solve):
    estimate = solve(noisy(scene, no_scan={"s06"}).problem())

    covariance = estimate.joint_covariance
    placed = [s for s in estimate.stations if s.pose is not None]
    anchors = [a for a in estimate.anchors if a.position is not None]
    assert estimate.joint_names == tuple(item.id for item in (*placed, *anchors))
    blocks = [s.covariance for s in placed] + [a.covariance for a in anchors]
    at = 0
    for block in blocks:
        size = len(block)
        np.testing.assert_allclose(covariance[at : at + size, at : at + size], block)
        at += size
    assert covariance.shape == (at, at)
    np.testing.assert_allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_a_residual_is_measured_minus_predicted(scene, solve):
    # One range in sixty is 1 m too long: its residual is positive and the largest by far.
    estimate = solve(scene.changed(long_ranges={("s05", "A4"): 1.0}).problem())

    residuals = {(k.station, k.anchor): k.residual for k in estimate.links}
    assert residuals["s05", "A4"] > 0.7
    assert max(abs(r) for pair, r in residuals.items() if pair != ("s05", "A4")) < 0.3


def test_pose_errors_are_what_the_covariances_say(scene, mode):
    # NEES of 33 pose coordinates together, 40 seeds: chi-square with 1320 degrees of freedom,
    # mean 1320, standard deviation 51; four of them either way.
    total = 0.0
    for seed in range(40):
        drawn = scene.changed(match_noise=1.0, seed=seed, anchors={})
        estimate = SOLVERS[mode](drawn.problem(), INDEPENDENT)
        first = drawn.stations[estimate.frame].inverse()
        errors = []
        for station in estimate.stations[1:]:
            error = station.pose.inverse() @ (first @ drawn.stations[station.id])
            errors.extend(error.vector)
        covariance = estimate.joint_covariance[3:, 3:]
        total += np.array(errors) @ np.linalg.solve(covariance, errors)
    assert 1320 - 4 * 51 < total < 1320 + 4 * 51


def test_anchor_errors_are_covered_under_gaussian_noise(scene, solve):
    # 60 anchors, 95 % ellipses: fewer than 50 inside would be overconfident, five deviations off.
    inside = 0
    for seed in range(12):
        drawn = scene.changed(match_noise=1.0, range_noise=0.1, seed=seed)
        estimate = solve(drawn.problem())
        first = drawn.stations[estimate.frame].inverse()
        for anchor in estimate.anchors:
            error = anchor.position - first.transform(drawn.anchors[anchor.id][:2])
            inside += error @ np.linalg.solve(anchor.covariance, error) < 5.991
    assert inside >= 51


# --- the sequential solver alone ----------------------------------------------------------------


def test_sequential_uses_the_plain_average_of_the_samples(scene):
    # The robust distances are right, the averages 1 m long: the paper uses the averages.
    problem = scene.problem()
    longer = tuple(replace(k, mean=k.distance + 1.0) for k in problem.links)

    estimate = SOLVERS["sequential"](replace(problem, links=longer), SETTINGS)

    assert min(scene.errors(estimate)[name] for name in scene.anchors) > 0.3
    assert [k.distance for k in estimate.links] == [k.distance for k in problem.links]


# --- the joint solver alone -----------------------------------------------------------------------


def joint(problem):
    return SOLVERS["joint"](problem, SETTINGS)


def test_joint_agrees_with_batch_levenberg_marquardt(scene):
    checks = joint(noisy(scene, no_scan={"s06"}).problem()).checks

    assert checks.isam2_batch_gap < 1e-5
    assert 1 < checks.iterations < SETTINGS.max_passes


@pytest.mark.parametrize("seed", [2, 21, 34])
def test_an_anchor_near_the_line_of_its_stations_does_not_jump_across_it_for_ever(scene, seed):
    # Without a leash Gauss-Newton takes 98 passes and more here, or never ends.
    line = {f"s{k}": Pose2(1.2 * k, 0.35 * (-1) ** k, 0.1 * k) for k in range(9)}
    rng = np.random.default_rng(1000 + seed)
    pairs = [(s, a) for s in line for a in scene.anchors]
    errors = {p: rng.normal(0, 0.08) + rng.gamma(1.3, 0.6) * (rng.random() < 0.4) for p in pairs}
    corridor = scene.changed(
        stations=line, seed=seed, match_noise=1.0, long_ranges=errors,
        range_offset=None, true_offset=0.2,
    )  # fmt: skip

    checks = joint(corridor.problem()).checks

    assert checks.iterations < 60
    assert checks.isam2_batch_gap < 1e-4


def test_joint_improves_a_poor_start(scene):
    problem = noisy(scene).problem()

    good, poor = joint(problem), joint(disturbed(problem, np.random.default_rng(5)))

    for name, place in places(good).items():
        np.testing.assert_allclose(places(poor)[name], place, atol=1e-6, err_msg=name)


def test_only_the_poses_that_scans_give_are_inflated(scene):
    # Errors that matches share are no error of the graph's: it stays as it is, to the bit.
    problem = noisy(scene).problem()
    plain = SOLVERS["joint"](problem, INDEPENDENT)
    wide = SOLVERS["joint"](problem, GraphSettings(pose_inflation=4.0))
    for one, other in zip(plain.stations, wide.stations, strict=True):
        assert one.pose == other.pose
        np.testing.assert_allclose(other.covariance, 4.0 * one.covariance, rtol=1e-9)
    for one, other in zip(plain.anchors, wide.anchors, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9)
    split = 3 * len(plain.stations)
    np.testing.assert_allclose(
        wide.joint_covariance[:split, split:], 2.0 * plain.joint_covariance[:split, split:],
        rtol=1e-6, atol=1e-12,
    )  # fmt: skip


def test_matches_that_disagree_more_than_they_say_widen_the_poses(scene):
    # Errors three times what the covariances promise; with the nine-fold covariances that the
    # disagreement asks for, the NEES of 33 coordinates over 20 seeds is 660 +- 36 again, and not
    # nine times that. (The scale itself is estimated from 30 degrees of freedom a survey: wider.)
    total = 0.0
    for seed in range(20):
        drawn = scene.changed(match_noise=3.0, seed=seed, anchors={}, max_pair=4.5)
        estimate = SOLVERS["joint"](drawn.problem(), INDEPENDENT)
        first = drawn.stations[estimate.frame].inverse()
        errors = [
            (s.pose.inverse() @ (first @ drawn.stations[s.id])).vector
            for s in estimate.stations[1:]
        ]
        vector = np.concatenate(errors)
        total += vector @ np.linalg.solve(estimate.joint_covariance[3:, 3:], vector)

    assert 500 < total < 900


def test_joint_finds_the_offset(scene):
    # Half of the links is 1 m long; the others tell the offset, its prior is 0.18 +- 0.10.
    rng = np.random.default_rng(2)
    pairs = [(s, a) for s in scene.stations for a in scene.anchors]
    walls = {pair: 1.0 for pair in pairs if rng.random() < 0.5}
    scene = scene.changed(range_offset=None, true_offset=0.3, long_ranges=walls)

    (bias,) = joint(scene.problem()).biases

    assert abs(bias.mean - 0.3) < 2.0 * bias.sigma < 2.0 * 0.09
    assert (bias.prior_mean, bias.prior_sigma) == (0.18, 0.10)


def test_long_ranges_hurt_joint_less_than_least_squares(scene):
    scene = noisy(scene, range_offset=None, true_offset=0.2)
    rms = {}
    for mode in MODES:
        errors = scene.errors(SOLVERS[mode](scene.problem(), SETTINGS))
        rms[mode] = math.sqrt(np.mean([errors[name] ** 2 for name in scene.anchors]))

    assert rms["joint"] < 0.2
    assert rms["sequential"] > 2.0 * rms["joint"]


def test_stations_side_by_side_count_as_one(scene):
    # A second tripod position 5 cm aside hears the same reflections: A1 gains nothing from it.
    twin = {"t01": scene.stations["s01"] @ Pose2(0.05, 0.0, 0.0)}
    crowded = scene.changed(stations={**scene.stations, **twin})

    one, two = (
        {a.id: a for a in joint(s.problem()).anchors}["A1"].covariance for s in (scene, crowded)
    )

    np.testing.assert_allclose(two, one, rtol=0.02)


def test_an_anchor_range_tells_the_sides_of_a_corridor_apart(scene):
    # Stations in line, one anchor known: the other, 10 m from it, is on the far side.
    line = {f"s{k}": Pose2(1.4 * k, 0.0, 0.0) for k in range(8)}
    scene = scene.changed(
        stations=line,
        anchors={"A": (4.0, 5.0, 2.5), "B": (4.5, -4.0, 2.5)},
        known_anchors={"A": KnownPlace(4.0, 5.0)},
        known_stations={"s0": KnownPlace(0.0, 0.0, 0.02, 0.0)},
        anchor_pairs=(("A", "B"),),
    )

    estimate = joint(scene.problem())

    anchor = {a.id: a for a in estimate.anchors}["B"]
    assert anchor.position is not None
    assert scene.errors(estimate)["B"] < EXACT_TO["joint"]


# --- walls and faults -------------------------------------------------------------------------------


def anchor_of(estimate, name):
    return {a.id: a for a in estimate.anchors}[name]


def reasons(estimate) -> dict[tuple[str, str], str]:
    return {(k.station, k.anchor): k.rejection for k in estimate.links if k.rejection is not None}


@pytest.mark.parametrize("seed", range(3))
def test_gross_faults_are_named_and_move_nothing(scene, seed):
    # Too long or short, on a sixth of the links; without a map, up to 4 m too long may be walls.
    rng = np.random.default_rng(seed)
    faults = {}
    for anchor in scene.anchors:
        for station in rng.permutation(sorted(scene.stations))[:2]:
            jump = rng.uniform(4.0, 30.0)
            short = rng.random() < 0.5 and scene.slant(station, anchor) > jump + 0.3
            faults[str(station), anchor] = -jump if short else jump
    clean = scene.changed(range_noise=0.05, match_noise=1.0, seed=seed)
    estimate = joint(clean.changed(long_ranges=faults).problem())

    assert statuses(estimate) == statuses(joint(clean.problem()))
    assert reasons(estimate).keys() == faults.keys()
    for pair, reason in reasons(estimate).items():
        assert ("short" if faults[pair] < 0.0 else "long") in reason
    assert max(scene.errors(estimate)[name] for name in scene.anchors) < 0.2


def test_identifiers_swapped_at_one_station_are_named(scene):
    problem = scene.changed(range_noise=0.05).problem()
    first, second = ("s03", "A1"), ("s03", "A3")
    of = {(k.station, k.anchor): k.distance for k in problem.links}
    swapped = {first: of[second], second: of[first]}
    links = tuple(
        replace(k, distance=swapped.get((k.station, k.anchor), k.distance)) for k in problem.links
    )

    estimate = joint(replace(problem, links=links))

    assert reasons(estimate) == {
        first: "fits anchor A3: identifiers swapped at this station",
        second: "fits anchor A1: identifiers swapped at this station",
    }
    assert max(scene.errors(estimate)[name] for name in scene.anchors) < 0.1


@pytest.mark.parametrize("split", [6, 8])
def test_an_anchor_that_was_moved_is_not_placed_and_both_places_are_told(scene, split):
    later = list(scene.stations)[split:]
    problem = scene.changed(range_noise=0.05).problem()
    there = scene.changed(anchors={**scene.anchors, "A2": (8.0, -2.0, 2.4)})
    shift = {name: there.slant(name, "A2") - scene.slant(name, "A2") for name in later}
    links = tuple(
        replace(k, distance=k.distance + shift[k.station])
        if k.anchor == "A2" and k.station in shift
        else k
        for k in problem.links
    )

    estimate = joint(replace(problem, links=links))

    moved = anchor_of(estimate, "A2")
    assert (moved.status, moved.position) == (Status.AMBIGUOUS, None)
    frame_T_plan = scene.stations["s01"].inverse()
    places = frame_T_plan.transform([(10.0, 0.2), (8.0, -2.0)])
    found = [(other.x, other.y) for other in moved.alternatives]
    np.testing.assert_allclose(found, places, atol=0.3)
    assert [other.weight for other in moved.alternatives] == pytest.approx(
        [split / 12, 1 - split / 12], abs=1e-9
    )
    assert "moved" in reasons(estimate)["s01", "A2"]
    assert {s for n, s in statuses(estimate).items() if n != "A2"} == {Status.OK}


WALL = ((5.4, -5.0), (5.4, 12.0))
"""Across the survey: five stations and two anchors on the right of it."""


def walled(scene, seed):
    """Ranges through the wall 0.2 to 2 m long, and a map that shows the wall."""
    rng = np.random.default_rng(seed)
    errors = {
        (s, a): float(rng.gamma(1.3, 0.5 / 1.3))
        for s, pose in scene.stations.items()
        for a, place in scene.anchors.items()
        if (pose.x < 5.4) != (place[0] < 5.4)
    }
    drawn = scene.changed(
        long_ranges=errors, range_noise=0.07, true_offset=0.2, range_offset=None, seed=seed
    )
    ends = np.array([scene.stations["s01"].inverse().transform(WALL)])
    pieces = WallPieces(ends, np.zeros(1), np.full(1, 0.96))
    return drawn, drawn.problem(), link_model(RangingSettings(), lambda _poses: pieces)


def test_walls_tell_which_ranges_are_long(scene):
    with_map, without = [], []
    for seed in range(4):
        drawn, problem, model = walled(scene, seed)
        for errors, posed in ((without, problem), (with_map, replace(problem, link_model=model))):
            found = drawn.errors(joint(posed))
            errors.extend(found[name] ** 2 for name in scene.anchors)

    assert np.mean(with_map) < 0.8 * np.mean(without)


def test_links_say_how_many_walls_they_cross(scene):
    drawn, problem, model = walled(scene, 1)

    estimate = joint(replace(problem, link_model=model))

    for link in estimate.links:
        behind = (link.station, link.anchor) in drawn.long_ranges
        # The map is believed at 96 %, the range has its say too.
        assert (link.nlos_probability > 0.5) == behind or abs(link.residual) > 0.3
        assert 0.0 <= link.walls <= 4.0


def test_an_anchor_on_a_wall_settles_on_one_side(scene):
    # Which side of the wall the anchor is on decides whether six links cross it, and these say where
    # it is: the rounds must end, at the same place from either side.
    on_wall = scene.changed(anchors={**scene.anchors, "A5": (5.4, 6.2, 2.1)})
    _, problem, model = walled(on_wall, 2)

    one, other = (
        joint(replace(problem, link_model=model, placement=placement))
        for placement in (problem.placement, disturbed(problem, np.random.default_rng(0)).placement)
    )

    for name, place in places(one).items():
        np.testing.assert_allclose(places(other)[name], place, atol=1e-3, err_msg=name)
    assert one.checks.isam2_batch_gap < 1e-4


def test_calibrated_radios_in_line_of_sight_are_least_squares(scene):
    settings = GraphSettings(radios="calibrated")
    ratios = []
    for seed in range(8):
        drawn = scene.changed(range_noise=0.07, range_offset=None, seed=seed)
        rms = {}
        for mode in MODES:
            errors = drawn.errors(SOLVERS[mode](drawn.problem(), settings))
            rms[mode] = math.sqrt(np.mean([errors[name] ** 2 for name in scene.anchors]))
        ratios.append(rms["joint"] / rms["sequential"])

    assert max(ratios) < 1.05


def test_an_offset_that_is_there_is_not_dropped(scene):
    for seed in range(4):
        drawn = scene.changed(range_noise=0.07, range_offset=None, true_offset=0.25, seed=seed)

        (bias,) = joint(drawn.problem()).biases

        assert abs(bias.mean - 0.25) < 3.0 * bias.sigma
        assert bias.sigma > 0.01


def test_without_a_model_of_the_links_there_is_no_joint_solution(scene):
    with pytest.raises(SolverError, match="model of the links"):
        joint(replace(scene.problem(), link_model=None))
