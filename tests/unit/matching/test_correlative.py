import math

import numpy as np
import pytest

from slam_uwb.matching.correlative import _oblique_turns, correlative_matches
from slam_uwb.model.geometry import Pose2

NEAR_M, NEAR_RAD = 0.3, math.radians(3.0)


def near(starts, truth):
    """(K,) whether a start is within the reach of the refiners."""
    return np.array([
        Pose2.from_vector(start).distance_to(truth) < NEAR_M
        and Pose2.from_vector(start).angle_to(truth) < NEAR_RAD
        for start in starts
    ])  # fmt: skip


def test_starts_contain_the_truth_for_any_offset(view, room, settings):
    rng = np.random.default_rng(0)
    for _ in range(25):
        a, b = (
            Pose2(rng.uniform(0.7, 3.6), rng.uniform(0.7, 2.6), rng.uniform(-math.pi, math.pi))
            for _ in range(2)
        )
        starts = correlative_matches(view("a", room, a, rng), view("b", room, b, rng), settings)
        assert near(starts, a.inverse() @ b).any()


@pytest.mark.parametrize("degrees", [0, 20, 90, 180, 270, 225])
@pytest.mark.parametrize("wall", [0, 40, 100])
def test_every_quarter_turn_is_found_first(view, room, settings, degrees, wall):
    """Of a room without symmetry, whichever way both scanners point."""
    a = Pose2(2.0, 1.5, math.radians(wall))
    b = Pose2(3.0, 2.2, math.radians(wall + degrees))
    starts = correlative_matches(view("a", room, a), view("b", room, b), settings)
    assert near(starts, a.inverse() @ b)[0]


def test_swapping_the_scans_inverts_the_best_start(view, room, settings):
    a, b = view("a", room, Pose2(2.0, 1.5, 0.5)), view("b", room, Pose2(3.0, 2.2, -2.0))
    forth = Pose2.from_vector(correlative_matches(a, b, settings)[0])
    back = Pose2.from_vector(correlative_matches(b, a, settings)[0])
    np.testing.assert_allclose((forth @ back).vector, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    "pair", [("s1", "s4"), ("s1", "s5"), ("s1", "s6"), ("s2", "s6"), ("s2", "s7")]
)
@pytest.mark.parametrize("swapped", [False, True])
def test_free_space_of_both_scans_decides_between_rooms(
    three_room_scans, three_room_poses, settings, pair, swapped
):
    """Walls alone put the truth of pairs in different rooms behind many others."""
    target, source = pair[::-1] if swapped else pair
    truth = three_room_poses[target].inverse() @ three_room_poses[source]
    starts = correlative_matches(three_room_scans[target], three_room_scans[source], settings)
    assert near(starts[:3], truth).any()


def test_no_more_starts_than_wanted_and_no_two_alike(three_room_scans, settings):
    few = settings.model_copy(update={"initial_matches": 6})
    for count in (settings, few):
        starts = correlative_matches(three_room_scans["s1"], three_room_scans["s3"], count)
        assert starts.shape == (count.initial_matches, 3)
        apart = np.hypot(*(starts[:, None, :2] - starts[None, :, :2]).transpose(2, 0, 1))
        turned = np.remainder(starts[:, None, 2] - starts[None, :, 2] + 1.0, 2 * math.pi) - 1.0
        alike = (apart < 0.29) & (np.abs(turned) < 0.01)
        np.testing.assert_array_equal(alike, np.eye(len(starts), dtype=bool))


def test_fewer_starts_are_the_first_of_more(three_room_scans, settings):
    few = settings.model_copy(update={"initial_matches": 6})
    a, b = three_room_scans["s1"], three_room_scans["s3"]
    np.testing.assert_array_equal(
        correlative_matches(a, b, few), correlative_matches(a, b, settings)[:6]
    )


def test_walls_at_right_angles_ask_for_no_further_rotation(view, room):
    target, source = view("a", room, Pose2(2.0, 1.5, 0.4)), view("b", room, Pose2(3.0, 2.2, -2.0))
    assert len(_oblique_turns(target.spectra, source.spectra)) == 0


def test_oblique_walls_are_brought_in_line(view, settings):
    """One scan's main walls are the other's oblique ones: a turn of 35 degrees beyond their alignment."""
    corners = np.array([(0, 0), (6, 0), (9, 2.1), (7.2, 4.6), (4.5, 2.7), (0, 2.7)], dtype=float)
    room = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    target_place, source_place = Pose2(1.5, 1.3, 0.3), Pose2(7.2, 2.8, -1.0)
    target, source = view("a", room, target_place), view("b", room, source_place)
    truth = target_place.inverse() @ source_place
    starts = correlative_matches(target, source, settings)
    turned = np.abs(np.remainder(starts[:, 2] - truth.theta + np.pi, 2 * np.pi) - np.pi)
    near = np.hypot(starts[:, 0] - truth.x, starts[:, 1] - truth.y) < 0.3
    assert (near & (turned < np.radians(4.0))).any()


def test_ends_that_wrap_round_do_not_stand_in_free_space(view, settings):
    """A corridor 25 m long, with niches: moved 2.7 m, its end 10 m behind leaves the grid and comes back ahead."""
    niches = [(4.0, 4.8, 2), (7.5, 8.6, 0), (13.2, 14.0, 2), (15.5, 16.7, 0), (19.0, 20.0, 2)]
    walls = [((0.0, 0.0), (0.0, 2.0)), ((25.0, 0.0), (25.0, 2.0))]
    for side, deep in ((0.0, -0.8), (2.0, 2.8)):
        along = [0.0]
        for first, last, of_side in niches:
            if of_side == side:
                walls += [((along[-1], side), (first, side)), ((first, side), (first, deep)),
                          ((first, deep), (last, deep)), ((last, deep), (last, side))]  # fmt: skip
                along.append(last)
        walls.append(((along[-1], side), (25.0, side)))
    rng = np.random.default_rng(1)
    for b in (12.5, 12.9, 13.3):
        target, source = Pose2(10.2, 1.1, 0.4), Pose2(b, 0.9, -2.0)
        starts = correlative_matches(
            view("a", walls, target, rng), view("b", walls, source, rng), settings
        )
        assert near(starts[:4], target.inverse() @ source).any()
