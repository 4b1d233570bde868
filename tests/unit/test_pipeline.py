"""The whole method: what cannot be told is said."""

import pytest

from slam_uwb import evaluate_solution, simulate_survey, solve_survey
from slam_uwb.model.errors import DisconnectedSurveyError
from slam_uwb.simulate import Lidar


@pytest.fixture(scope="module")
def twins():
    """Two congruent rooms with a door between them: either may be the other."""
    return simulate_survey("twin-rooms", 310, lidar=Lidar(duration=20.0, upper_duration=0.0))


def test_without_ranges_twin_rooms_are_no_survey_but_named(twins):
    with pytest.raises(DisconnectedSurveyError, match="fits at more than one place"):
        solve_survey(twins.survey, use_ranges=False)


def test_two_rooms_laid_over_each_other_are_doubted_though_little_speaks_for_another_place():
    # Two stations of either room are laid over each other; the four others fit that room weakly, with
    # 0.6 to 3.4 m of wall, at two or three places each.
    twins = simulate_survey("twin-rooms", 1407, lidar=Lidar(duration=60.0, upper_duration=0.0))

    with pytest.raises(DisconnectedSurveyError, match="fits at more than one place"):
        solve_survey(twins.survey, use_ranges=False)


def test_ranges_tell_twin_rooms_apart(twins):
    evaluation = evaluate_solution(solve_survey(twins.survey), twins.reference)
    assert evaluation.stations.not_ok == ()
    assert evaluation.stations.ok_errors.max < 0.03
