import numpy as np
import pytest

from slam_uwb.matching.batch import compose, transform
from slam_uwb.matching.pairing import pair_points
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)


@pytest.fixture
def pair(view, room):
    """Two scans of a room, and two poses near the true one."""
    truth = (A.inverse() @ B).vector
    off = np.array([[0.03, -0.02, 0.01], [-0.1, 0.05, -0.03]])
    return view("a", room, A), view("b", room, B), compose(np.tile(truth, (2, 1)), off)


def test_partners_found_by_search_are_the_nearest_points(pair):
    target, source, poses = pair
    found = pair_points(target, source, poses, exact=True)
    moved = transform(poses, source.scan.points)
    apart = np.linalg.norm(moved[:, :, None] - target.scan.points[None, None], axis=3)
    np.testing.assert_allclose(np.sqrt(found.squared), apart.min(axis=2), atol=1e-9)


@pytest.mark.parametrize("exact", [True, False])
def test_what_is_told_of_partners_is_theirs(pair, exact):
    """Residual, distance and normals, computed point by point in the target's scanner frame."""
    target, source, poses = pair
    found = pair_points(target, source, poses, exact=exact)
    offset = transform(poses, source.scan.points) - target.scan.points[found.partner]
    normals = target.scan.normals[found.partner]
    np.testing.assert_allclose(found.squared, (offset**2).sum(axis=2), atol=1e-9)
    np.testing.assert_allclose(found.across, (offset * normals).sum(axis=2), atol=1e-9)
    for k, pose in enumerate(poses):
        turned = normals[k] @ Pose2.from_vector(pose).rotation
        np.testing.assert_allclose(found.normal_x[k], turned[:, 0], atol=1e-9)
        np.testing.assert_allclose(found.normal_y[k], turned[:, 1], atol=1e-9)
        facing = (turned * source.scan.normals).sum(axis=1)
        np.testing.assert_allclose(found.facing[k], facing, atol=1e-9)


def test_a_stride_takes_every_so_manieth_point(pair):
    target, source, poses = pair
    every, third = (pair_points(target, source, poses, stride=stride) for stride in (1, 3))
    np.testing.assert_array_equal(third.partner, every.partner[:, ::3])
    np.testing.assert_array_equal(third.across, every.across[:, ::3])


def test_places_far_outside_the_table_find_a_partner_too(pair):
    target, source, _ = pair
    far = np.array([[1e12, -1e12, 1.0]])
    assert (pair_points(target, source, far).squared > 1e23).all()
