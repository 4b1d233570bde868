import numpy as np
import pytest

from slam_uwb.simulate.plan import Room, Wall, build_plan
from slam_uwb.simulate.scene import Scene


def ring(length, depth, thickness=0.2):
    corners = [(0.0, 0.0), (length, 0.0), (0.0, depth), (length, depth)]
    return [Wall(corners[a], corners[b], thickness) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]


@pytest.fixture
def hall() -> Scene:
    """One empty room, inner faces at 0 and 40 by 0 and 6 m; stations at (5, 3) and (7, 3)."""
    plan = build_plan(
        [],
        [Room(0, 0, 40, 6)],
        [Room(-1, -1, 0, 7), Room(40, -1, 41, 7), Room(-1, -1, 41, 0), Room(-1, 6, 41, 7)],
    )
    return Scene(
        name="hall",
        walls=plan.faces,
        partitions=np.empty((0, 2, 2)),
        stations=np.array([[5.0, 3.0], [7.0, 3.0]]),
        anchors=np.array([[5.0, 5.9, 2.4], [1.0, 1.0, 1.9]]),
        sequence=((0, 1),),
    )


@pytest.fixture
def three_rooms() -> Scene:
    """Rooms of 4 x 3 m in a row, walls at x = 4 (door 1 to 2 m up) and x = 8 (closed)."""
    walls = [*ring(12.0, 3.0), Wall((4, 0), (4, 3), 0.1, ((1.5, 1.0),)), Wall((8, 0), (8, 3), 0.1)]
    plan = build_plan(walls, [])
    return Scene(
        name="three-rooms",
        walls=plan.faces,
        partitions=plan.partitions,
        stations=np.array([[2.0, 1.5], [2.0, 0.5], [6.0, 1.5]]),
        anchors=np.array([[6.0, 1.5, 2.4], [6.0, 0.5, 2.4], [10.0, 1.5, 2.4], [10.0, 0.5, 2.4]]),
        sequence=((0, 1), (0, 2)),
        lintels=plan.lintels,
    )
