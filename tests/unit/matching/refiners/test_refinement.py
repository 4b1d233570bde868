import numpy as np
import pytest

from slam_uwb.matching import Refinement


@pytest.mark.parametrize(
    ("poses", "converged", "iterations", "wrong"),
    [
        (np.zeros(3), [True], None, "poses"),
        (np.zeros((2, 3)), [True], None, "converged"),
        (np.zeros((2, 3)), [True, False], [1], "iterations"),
    ],
)
def test_every_pose_has_its_row(poses, converged, iterations, wrong):
    with pytest.raises(ValueError, match=wrong):
        Refinement(poses, np.array(converged), iterations)


def test_nothing_can_be_changed_from_outside():
    poses = np.zeros((1, 3))
    refined = Refinement(poses, np.array([True]), np.array([4]))
    poses[0] = 1.0
    assert not refined.poses.any()
    for array in (refined.poses, refined.converged, refined.iterations):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
