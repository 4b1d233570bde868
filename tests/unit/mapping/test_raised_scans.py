"""The heading of a raised scan: exact where walls are seen, found past furniture and lintels, never guessed."""

import math

import numpy as np
import pytest

from slam_uwb.mapping.raised_scans import station_T_raised
from slam_uwb.model.geometry import Pose2


@pytest.mark.parametrize("turn_deg", [-179.7, -90.0, 0.0, 13.3, 120.0, 179.9])
def test_finds_the_turn_past_furniture(outline, look, turn_deg):
    room = outline((0, 0), (6, 0), (6, 4), (3.5, 4), (3.5, 5.5), (0, 5.5))
    cupboards = np.concatenate(
        [outline((0.1, 0.1), (1.5, 0.1), (1.5, 0.6), (0.1, 0.6)),
         outline((5.2, 1), (5.9, 1), (5.9, 2.5), (5.2, 2.5))]
    )  # fmt: skip
    place = Pose2(2.2, 2.7, 0.4)
    raised = place @ Pose2(0.0, 0.0, math.radians(turn_deg))
    found = station_T_raised(look(np.concatenate([room, cupboards]), place), look(room, raised))
    assert found is not None
    assert found.distance_to(Pose2.identity()) == 0.0
    # Ranges a degree apart are compared to a twentieth of one.
    assert found.angle_to(Pose2(0.0, 0.0, math.radians(turn_deg))) < math.radians(0.15)


def test_says_nothing_where_the_scans_have_nothing_in_common(outline, look):
    hall = look(outline((0, 0), (20, 0), (20, 15), (0, 15)), Pose2(7.0, 6.0, 0.0))
    closet = look(outline((0, 0), (2, 0), (2, 1.5), (0, 1.5)), Pose2(0.7, 0.6, 0.0))
    assert station_T_raised(hall, closet) is None


def test_says_nothing_of_an_empty_scan(look):
    nothing = look(np.array([[[500.0, 0.0], [500.0, 1.0]]]), Pose2.identity())
    assert len(nothing.points) == 0
    assert station_T_raised(nothing, nothing) is None
