"""Real recordings are solved, and what is not known is not claimed."""

import pytest

from slam_uwb import Settings, evaluate_solution, read_reference, read_survey, solve_survey

pytestmark = pytest.mark.real


def solve(folder, name, mode="joint", use_ranges=True):
    settings = Settings(graph=Settings().graph.model_copy(update={"mode": mode}))
    solution = solve_survey(read_survey(folder / name), settings, use_ranges=use_ranges)
    return solution, evaluate_solution(solution, read_reference(folder / name / "reference"))


@pytest.fixture(scope="module")
def flat(surveys_folder):
    return {
        mode: solve(surveys_folder, "kolakowski-flat", mode)[1] for mode in ("joint", "sequential")
    }


def test_the_flat_is_placed(flat):
    stations = flat["joint"].stations
    assert stations.ok_errors.count == 21
    assert stations.ok_errors.max <= 0.11


def test_the_flat_is_placed_by_its_scans_alone(surveys_folder):
    stations = solve(surveys_folder, "kolakowski-flat", use_ranges=False)[1].stations
    assert stations.ok_errors.count == 21
    assert stations.ok_errors.max <= 0.11


def test_the_joint_anchors_of_the_flat_are_better_than_the_sequential_ones(flat):
    joint, sequential = flat["joint"].anchors, flat["sequential"].anchors
    assert joint.ok_errors.count >= 5
    # Least squares at the reference poses gives 0.61 m (all links are long); a one-sided loss with
    # a common offset 0.14 m.
    assert joint.ok_errors.rmse < 0.5 * sequential.ok_errors.rmse
    assert joint.ok_errors.max < 0.6


def test_a_survey_without_ranges_gives_a_map(surveys_folder):
    solution, evaluation = solve(surveys_folder, "tau-lab446a")
    placed = [s for s in solution.stations if s.pose is not None]
    assert len(placed) >= 4
    assert evaluation.stations.ok_errors.max < 0.08
    assert solution.floor_map is not None
    assert (solution.floor_map.occupancy > 0.65).sum() > 100


def test_known_stations_locate_the_anchors_of_a_hall(surveys_folder):
    solution, evaluation = solve(surveys_folder, "lias-hall")
    assert solution.frame == "site"
    assert evaluation.anchors.ok_errors.count == 8
    assert evaluation.anchors.ok_errors.rmse <= 0.25
    # No scan and no survey says which way the tripod looked.
    assert not any(s.heading_known for s in solution.stations)
