import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2, freeze_arrays, frozen_array, rotation_matrix, wrap_angle


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (math.pi, math.pi),
        (-math.pi, math.pi),
        (1.5 * math.pi, -0.5 * math.pi),
        (-1.5 * math.pi, 0.5 * math.pi),
        (4.0 * math.pi, 0.0),
    ],
)
def test_angles_are_wrapped_into_the_half_open_turn(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-15)


def test_rotation_is_counter_clockwise():
    np.testing.assert_allclose(rotation_matrix(math.pi / 2) @ [1.0, 0.0], [0.0, 1.0], atol=1e-15)


def test_transform_turns_before_it_moves():
    # (1, 0) turned by 90 degrees is (0, 1); moved by (2, 3) it is (2, 4).
    moved = Pose2(2.0, 3.0, math.pi / 2).transform([1.0, 0.0])
    np.testing.assert_allclose(moved, [2.0, 4.0], atol=1e-15)


def test_composition_cancels_neighbouring_frames():
    # b stands 2 m ahead of a and looks left; c stands 1 m ahead of b: 2 m ahead of a, 1 m to its left.
    a_T_c = Pose2(2.0, 0.0, math.pi / 2) @ Pose2(1.0, 0.0, 0.0)
    np.testing.assert_allclose(a_T_c.vector, [2.0, 1.0, math.pi / 2], atol=1e-15)


def test_inverse_of_a_known_pose():
    # Seen from 1 m ahead, looking left, the origin is 1 m to the left and looks right.
    inverse = Pose2(1.0, 0.0, math.pi / 2).inverse()
    np.testing.assert_allclose(inverse.vector, [0.0, 1.0, -math.pi / 2], atol=1e-15)


def test_transform_keeps_the_shape_of_its_points():
    pose = Pose2(1.0, 2.0, 0.3)
    assert pose.transform([1.0, 2.0]).shape == (2,)
    assert pose.transform(np.zeros((5, 2))).shape == (5, 2)
    assert pose.transform(np.zeros((0, 2))).shape == (0, 2)


def test_distance_and_angle_between_poses():
    a, b = Pose2(0.0, 0.0, math.radians(179)), Pose2(3.0, 4.0, math.radians(-179))
    assert a.distance_to(b) == pytest.approx(5.0)
    assert a.angle_to(b) == pytest.approx(math.radians(2.0))
    assert b.angle_to(a) == pytest.approx(math.radians(2.0))


def test_vector_and_back():
    pose = Pose2(1.0, -2.0, 3.0)
    assert Pose2.from_vector(pose.vector) == pose
    with pytest.raises(ValueError, match="values to unpack"):
        Pose2.from_vector([1.0, 2.0])


def test_poses_do_not_change():
    pose = Pose2(1.0, 2.0, 0.3)
    with pytest.raises(dataclasses.FrozenInstanceError):
        pose.x = 0.0


def test_frozen_array_is_a_copy_that_nobody_changes():
    mine = np.array([1.0, 2.0])
    frozen = frozen_array(mine, (2,), "place")
    mine[0] = 9.0
    assert frozen[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 9.0


@pytest.mark.parametrize("value", [np.zeros(3), np.zeros((2, 3)), np.zeros((3, 2, 1)), 1.0])
def test_frozen_array_names_what_has_the_wrong_shape(value):
    with pytest.raises(ValueError, match="walls has shape"):
        frozen_array(value, (None, 2), "walls")


@dataclass(frozen=True, slots=True, eq=False)
class Holder:
    place: object
    ends: object

    def __post_init__(self):
        freeze_arrays(self, place=(2,), ends=(None, 2))


def test_arrays_of_a_frozen_value_are_read_only_copies():
    mine = np.array([1.0, 2.0])
    holder = Holder(mine, [[3, 4]])
    mine[0] = 9.0
    np.testing.assert_array_equal(holder.place, [1.0, 2.0])
    assert not holder.place.flags.writeable
    np.testing.assert_array_equal(holder.ends, [[3.0, 4.0]])


@pytest.mark.parametrize("ends", [[1.0, 2.0, 3.0], None])
def test_an_array_of_a_wrong_shape_or_none_is_named(ends):
    with pytest.raises(ValueError, match=r"ends has shape"):
        Holder([1.0, 2.0], ends)
