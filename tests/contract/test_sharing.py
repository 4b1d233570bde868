"""A survey solved by several processes is the survey solved by one, to the last bit."""

import numpy as np
import pytest

from slam_uwb import sharing, simulate_survey, solve_survey
from slam_uwb.report.pictures import solution_pictures
from slam_uwb.simulate import Lidar, Radio


@pytest.mark.parametrize("scene", ["flat", "twin-rooms"])
def test_the_result_does_not_depend_on_the_processes(scene):
    made = simulate_survey(
        scene, 3, lidar=Lidar(duration=4.0, upper_duration=0.0), radio=Radio(duration=4.0)
    )
    one = solve_survey(made.survey)
    with sharing(2, ["pipeline"]) as share:
        two = solve_survey(made.survey, share=share)
        pictures = solution_pictures(two, share)
    assert _same(two.matches, one.matches)
    assert [s.pose for s in two.stations] == [s.pose for s in one.stations]
    assert [a.status for a in two.anchors] == [a.status for a in one.anchors]
    np.testing.assert_array_equal(two.joint_covariance, one.joint_covariance)
    np.testing.assert_array_equal(
        [a.position for a in two.anchors if a.position is not None],
        [a.position for a in one.anchors if a.position is not None],
    )
    assert pictures == solution_pictures(one)


def _same(two, one):
    rows = zip(two, one, strict=True)
    return all(
        (a.ends, a.target_T_source, a.rank, a.score, a.rejection)
        == (b.ends, b.target_T_source, b.rank, b.score, b.rejection)
        and np.array_equal(a.covariance, b.covariance)
        for a, b in rows
    )
