"""TUM files, read back by code of the test's own."""

import math

import numpy as np
import pytest

from slam_uwb.evaluate import estimate_to_tum, reference_to_tum
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import Solution, StationEstimate, Status
from slam_uwb.model.survey import Reference, ReferencePlace

POSES = {"s1": Pose2(1.0, 2.0, 0.5), "s2": Pose2(-3.0, 0.25, -3.0), "s3": Pose2(0.0, 0.0, math.pi)}


def solution(**status):
    stations = tuple(
        StationEstimate(name, pose, np.eye(3), status.get(name, Status.OK))
        for name, pose in POSES.items()
    )
    return Solution(
        "s", "", "joint", Settings(), "0", "s1", stations, (), (), (), (), (), None, None, None, {}
    )


def poses(text):
    """Time stamp -> (x, y, theta), by way of the rotation matrix of the quaternion."""
    found = {}
    for line in text.splitlines():
        t, x, y, z, qx, qy, qz, qw = map(float, line.split())
        assert (z, qx, qy) == (0.0, 0.0, 0.0)
        assert qx**2 + qy**2 + qz**2 + qw**2 == pytest.approx(1.0)
        # First column of the rotation matrix of a unit quaternion.
        found[t] = (
            x,
            y,
            math.atan2(2 * (qx * qy + qz * qw), qw**2 + qx**2 - qy**2 - qz**2),
        )
    return found


def test_poses_come_back_with_the_stations_numbers():
    found = poses(estimate_to_tum(solution()))
    assert list(found) == [0.0, 1.0, 2.0]
    for (x, y, theta), pose in zip(found.values(), POSES.values(), strict=True):
        back = Pose2(x, y, theta)
        assert back.distance_to(pose) < 1e-8
        assert back.angle_to(pose) < 1e-8


def test_what_is_not_trusted_is_left_out_and_the_numbers_stay():
    doubtful = solution(s2=Status.WEAK_GEOMETRY)
    assert list(poses(estimate_to_tum(doubtful))) == [0.0, 2.0]


def test_the_reference_has_the_same_numbers():
    truth = Reference(
        {
            "s3": ReferencePlace(1.0, 1.0, 0.0),
            "s1": ReferencePlace(5.0, 6.0, 1.0),
            "s2": ReferencePlace(0.0, 0.0),
            "other": ReferencePlace(0.0, 0.0, 0.0),
        },
        {},
    )
    found = poses(reference_to_tum(solution(), truth))
    assert found == {0.0: pytest.approx((5.0, 6.0, 1.0)), 2.0: pytest.approx((1.0, 1.0, 0.0))}
