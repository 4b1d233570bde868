import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.directions import wall_angle
from slam_uwb.model.geometry import Pose2


@pytest.mark.parametrize("degrees", [0.0, 10.0, -30.0, 44.0, -44.0, 100.0, 191.0])
def test_wall_angle_of_a_turned_scanner(view, room, degrees):
    # The walls run along x and y of the plan: seen from a scanner turned by theta they run along -theta.
    index = view("a", room, Pose2(2.0, 1.5, math.radians(degrees)))
    away = np.remainder(wall_angle(index.scan) + math.radians(degrees), math.pi / 2)
    assert min(away, math.pi / 2 - away) == pytest.approx(0.0, abs=1e-6)
    assert -math.pi / 4 <= wall_angle(index.scan) < math.pi / 4


@pytest.mark.parametrize("degrees", [13.0, 45.0, 90.0, 137.0])
def test_wall_angle_turns_with_the_scan(view, three_rooms, degrees):
    rng = np.random.default_rng(3)
    pose = Pose2(4.3, 1.3, -1.1)
    scan = view("a", three_rooms, pose, rng).scan
    turn = Pose2(0.0, 0.0, math.radians(degrees))
    turned = replace(scan, points=turn.transform(scan.points), normals=turn.transform(scan.normals))
    away = np.remainder(wall_angle(turned) - wall_angle(scan) - turn.theta, math.pi / 2)
    assert min(away, math.pi / 2 - away) == pytest.approx(0.0, abs=math.radians(0.05))


def test_wall_angle_of_noisy_walls_is_right_to_a_tenth_of_a_degree(view, room):
    rng = np.random.default_rng(4)
    angles = [wall_angle(view("a", room, Pose2(2.0, 1.5, 0.3), rng, 0.01).scan) for _ in range(20)]
    np.testing.assert_allclose(angles, -0.3, atol=math.radians(0.3))
    assert np.mean(angles) == pytest.approx(-0.3, abs=math.radians(0.1))


def test_most_metres_of_wall_decide_the_wall_angle_not_most_points(view):
    # 8 + 3 m of wall along x and y far off, and 1 m at 30 degrees close by, which takes more points.
    half = 0.5 * np.array([math.cos(math.radians(30.0)), math.sin(math.radians(30.0))])
    middle = np.array([0.1, -0.3])
    walls = [((-4, 6), (4, 6)), ((4, 6), (4, 3)), (middle - half, middle + half)]
    index = view("a", walls, Pose2.identity())
    oblique = index.scan.points[:, 1] < 1.0
    assert oblique.sum() > (~oblique).sum()
    assert wall_angle(index.scan) == pytest.approx(0.0, abs=1e-3)


def test_no_wall_no_angle(view):
    scan = view("a", [((2, -0.02), (2, 0.02)), ((-2, -0.02), (-2, 0.02))], Pose2.identity()).scan
    assert wall_angle(scan) == 0.0
