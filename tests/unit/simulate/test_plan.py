import numpy as np
import pytest

from slam_uwb.simulate.plan import Room, Wall, build_plan, outline


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=-1)


def as_set(segments):
    return {tuple(sorted(map(tuple, np.round(s, 6).tolist()))) for s in segments}


def test_overlapping_rectangles_have_one_outline():
    # [0, 2] and [1, 3] wide, 1 deep: together 3 x 1.
    faces = outline(np.array([[0, 0, 2, 1], [1, 0, 3, 1]], float))
    assert as_set(faces) == {
        ((0.0, 0.0), (3.0, 0.0)),
        ((0.0, 1.0), (3.0, 1.0)),
        ((0.0, 0.0), (0.0, 1.0)),
        ((3.0, 0.0), (3.0, 1.0)),
    }


def test_faces_that_only_touch_are_inside_the_wall():
    # A bar of 3 x 1 and one of 1 x 2 on its middle: a T of perimeter 2 (3 + 3) = 12 with 8 sides.
    faces = outline(np.array([[0, 0, 3, 1], [1, 1, 2, 3]], float))
    assert len(faces) == 8
    assert lengths(faces).sum() == pytest.approx(12.0)


def test_rounding_leaves_no_gap_between_walls():
    # 0.1 + 0.2 is a little more than 0.3.
    faces = outline(np.array([[0, 0, 0.3, 1], [0.1 + 0.2, 0, 1, 1]], float))
    assert len(faces) == 4


def test_a_ring_of_walls_has_an_inside_and_an_outside():
    corners = [(0.0, 0.0), (6.0, 0.0), (0.0, 4.0), (6.0, 4.0)]
    ring = [Wall(corners[a], corners[b], 0.2) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]
    # Inner 5.8 x 3.8, outer 6.2 x 4.2.
    assert lengths(build_plan(ring, []).faces).sum() == pytest.approx(2 * (9.6 + 10.4))


def test_a_door_opens_the_wall_for_light_and_radio_and_has_a_lintel():
    plan = build_plan([Wall((0, 0), (4, 0), 0.2, ((2.0, 1.0),))], [])
    # Slabs from -0.1 to 1.5 and from 2.5 to 4.1 m, 0.2 m thick.
    assert len(plan.faces) == 8
    assert lengths(plan.faces).sum() == pytest.approx(4 * (1.6 + 0.2))
    assert as_set(plan.partitions) == {((0.0, 0.0), (1.5, 0.0)), ((2.5, 0.0), (4.0, 0.0))}
    assert as_set(plan.lintels) == {((1.5, -0.1), (2.5, -0.1)), ((1.5, 0.1), (2.5, 0.1))}
    np.testing.assert_allclose(plan.doors, [[2.0, 0.0]])


def test_columns_are_seen_but_are_no_walls_to_the_radio():
    wall = Wall((0, 0), (4, 0), 0.2)
    plan = build_plan([wall], [], [Room(1.0, 0.1, 1.4, 0.4)])
    assert lengths(plan.faces).sum() == pytest.approx(2 * (4.2 + 0.2) + 2 * 0.3)
    assert len(plan.partitions) == 1


def test_a_door_beyond_the_end_of_its_wall_is_refused():
    with pytest.raises(ValueError, match="do not fit"):
        build_plan([Wall((0, 0), (4, 0), 0.2, ((3.9, 1.0),))], [])
