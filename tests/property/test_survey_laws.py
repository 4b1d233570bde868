"""Laws of a whole survey: exact without noise, and the same whatever its frame and order."""

from dataclasses import replace

import numpy as np
import pytest

from slam_uwb import Settings, evaluate_solution, solve_survey
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import KnownPlace, RangeOffset, Scan
from slam_uwb.simulate import Lidar, Radio, Scene, Simulation, simulate_survey

MODES = ("joint", "sequential")


def polygon(*corners):
    """Sides (N, 2, 2) of a closed polygon."""
    points = np.array(corners, dtype=float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


# One L-shaped room of no symmetry with a pillar: every wall that two scans share is long enough
# for exact normals, and no two places look alike.
ROOM = Scene(
    name="room",
    walls=np.concatenate([
        polygon((0, 0), (9, 0), (9, 4), (5, 4), (5, 7), (0, 7)),
        polygon((2.6, 2.2), (3.4, 2.2), (3.4, 3.4), (2.6, 3.4)),
    ]),
    partitions=np.empty((0, 2, 2)),
    stations=[(1.0, 1.2), (4.2, 1.4), (7.5, 1.5), (6.0, 3.1), (4.1, 5.5), (1.2, 5.0)],
    anchors=[(0.1, 0.1, 2.4), (8.9, 0.2, 2.1), (8.8, 3.9, 2.5), (0.2, 6.8, 2.2)],
    sequence=((0, 1), (1, 2), (2, 3), (3, 4), (4, 5)),
)  # fmt: skip


def mode_settings(mode):
    return Settings(graph=Settings().graph.model_copy(update={"mode": mode}))


def exact(seed=3, scene=ROOM) -> Simulation:
    simulation = simulate_survey(
        scene,
        seed,
        lidar=Lidar.noise_free(duration=2.0, upper_duration=0.0),
        radio=Radio.noise_free(duration=2.0),
    )
    # The ranges have no offset, and the survey says so: the prior's mean is the truth.
    return replace(
        simulation, survey=replace(simulation.survey, range_offset=RangeOffset(0.0, 0.05))
    )


@pytest.fixture(scope="module")
def noisy() -> Simulation:
    return simulate_survey(
        ROOM, 5, lidar=Lidar(duration=10.0, upper_duration=0.0), radio=Radio(duration=5.0)
    )


@pytest.fixture(scope="module")
def solved(noisy):
    return {mode: solve_survey(noisy.survey, mode_settings(mode)) for mode in MODES}


@pytest.mark.parametrize("mode", MODES)
def test_a_noise_free_survey_is_solved_exactly(mode):
    simulation = exact()
    evaluation = evaluate_solution(
        solve_survey(simulation.survey, mode_settings(mode)), simulation.reference
    )
    assert not evaluation.stations.not_ok
    assert not evaluation.anchors.not_ok
    assert evaluation.stations.ok_errors.max < 1e-6
    assert evaluation.stations.ok_heading_errors.max < 1e-6
    assert evaluation.anchors.ok_errors.max < 1e-6


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("scene", "seed"), [("flat", 1), ("flat", 2), ("paper-office", 1)])
def test_furnished_rooms_and_doors_are_no_obstacle_to_exactness(scene, seed, mode):
    """Pairs held by door jambs alone, and clutter without partners: where walls are exact, so is the map."""
    simulation = exact(seed, scene)
    evaluation = evaluate_solution(
        solve_survey(simulation.survey, mode_settings(mode)), simulation.reference
    )
    assert evaluation.stations.ok_errors.max < 1e-6
    assert evaluation.anchors.ok_errors.max < 1e-6


def places(solution):
    """Station poses and anchor places in the frame of s01, by name."""
    poses = {s.id: s.pose for s in solution.stations}
    first = poses["s01"].inverse()
    stations = {name: (first @ pose).vector for name, pose in poses.items()}
    anchors = {a.id: first.transform(a.position) for a in solution.anchors}
    return stations | anchors


def assert_same_places(one, other, tolerance):
    one, other = places(one), places(other)
    assert one.keys() == other.keys()
    for name, place in one.items():
        difference = place - other[name]
        if len(difference) == 3:
            difference[2] = np.remainder(difference[2] + np.pi, 2 * np.pi) - np.pi
        assert np.abs(difference).max() < tolerance, name


@pytest.mark.parametrize("mode", MODES)
def test_the_order_of_stations_anchors_and_samples_changes_the_frame_alone(noisy, solved, mode):
    survey = noisy.survey

    def backwards(station):
        scan = Scan(station.scan.bearings[::-1], station.scan.ranges[::-1], station.scan.max_range)
        return replace(station, scan=scan)

    shuffled = replace(
        survey,
        stations=tuple(backwards(station) for station in survey.stations[::-1]),
        anchors=survey.anchors[::-1],
        ranges=survey.ranges[::-1],
    )
    solution = solve_survey(shuffled, mode_settings(mode))
    assert solution.frame == "s06"
    assert_same_places(solution, solved[mode], 1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_turning_the_scanner_turns_the_heading_alone(noisy, solved, mode):
    # Turned by whole angle bins, so that each bin keeps its samples.
    turns = {station.id: 7.0 * k for k, station in enumerate(noisy.survey.stations)}

    def turned(station):
        bearings = station.scan.bearings - np.radians(turns[station.id])
        return replace(station, scan=Scan(bearings, station.scan.ranges, station.scan.max_range))

    survey = replace(noisy.survey, stations=tuple(turned(s) for s in noisy.survey.stations))
    solution = solve_survey(survey, mode_settings(mode))
    stations = tuple(
        replace(s, pose=s.pose @ Pose2(0.0, 0.0, -np.radians(turns[s.id])))
        for s in solution.stations
    )
    assert_same_places(replace(solution, stations=stations), solved[mode], 1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_moving_the_site_frame_moves_everything_with_it(noisy, mode):
    truth = noisy.reference.stations

    def with_site(site_T_plan):
        def surveyed(station):
            if station.id not in ("s01", "s04"):
                return station
            place = site_T_plan @ Pose2(truth[station.id].x, truth[station.id].y, 0.0)
            return replace(station, known=KnownPlace(place.x, place.y))

        return replace(noisy.survey, stations=tuple(surveyed(s) for s in noisy.survey.stations))

    moved = Pose2(-120.0, 45.0, 2.1)
    here = solve_survey(with_site(Pose2.identity()), mode_settings(mode))
    there = solve_survey(with_site(moved), mode_settings(mode))
    assert here.frame == there.frame == "site"
    for a, b in zip(here.stations, there.stations, strict=True):
        assert (moved @ a.pose).distance_to(b.pose) < 1e-6
        assert (moved @ a.pose).angle_to(b.pose) < 1e-6
    for a, b in zip(here.anchors, there.anchors, strict=True):
        gap = np.hypot(*(moved.transform(a.position) - b.position))
        assert gap < 1e-6
        rotated = moved.rotation @ a.covariance @ moved.rotation.T
        np.testing.assert_allclose(rotated, b.covariance, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_solving_twice_gives_the_same_numbers(noisy, solved, mode):
    again = solve_survey(noisy.survey, mode_settings(mode))
    assert_same_places(again, solved[mode], 1e-300)
    assert [m.score for m in again.matches] == [m.score for m in solved[mode].matches]
