import numpy as np
import pytest

from slam_uwb.simulate.placing import NoPlaceError, anchor_on_wall, first_place, place_stations
from slam_uwb.simulate.plan import Room, Wall, build_plan

# A wall along x = 0 from y = -3 to 3 with a door of 1 m in its middle; faces at x = -0.1 and 0.1.
PLAN = build_plan([Wall((0, -3), (0, 3), 0.2, ((0.0, 1.0),))], [])


@pytest.mark.parametrize(
    ("unfit", "why"),
    [
        ((0.4, 0.9), "0.3 m from the wall"),
        ((-1.0, 0.5), "0.5 m from the station before"),
        ((0.8, -1.5), "behind the wall, 2.3 m away"),
        ((2.5, 0.0), "3.5 m away"),
    ],
)
def test_the_first_fit_place_is_taken(unfit, why):
    previous, fit = np.array([-1.0, 0.0]), (1.0, 0.0)
    chosen = first_place(PLAN, np.array([unfit, fit, (1.1, 0.0)]), [previous], previous)
    np.testing.assert_array_equal(chosen, fit, err_msg=why)


def test_no_place_is_an_answer():
    with pytest.raises(NoPlaceError):
        first_place(PLAN, np.array([[0.3, 2.0]]), [], None)
    with pytest.raises(NoPlaceError):
        first_place(PLAN, np.empty((0, 2)), [], None)


def test_stations_stay_near_the_wanted_places():
    wanted = [(-1.5, 0.0), (1.0, 0.0)]
    places = place_stations(np.random.default_rng(0), PLAN, wanted, [(0, 1)], jitter=0.1)
    assert np.abs(places - wanted).max() <= 0.3


@pytest.mark.parametrize(("side", "fixed"), [("w", 0.16), ("e", 3.94)])
def test_anchors_hang_on_their_wall_beside_the_door(side, fixed):
    room = Room(0.1, -3.0, 4.0, 3.0)
    for seed in range(20):
        x, y, z = anchor_on_wall(np.random.default_rng(seed), PLAN, room, side, 0.5, jitter=0.6)
        assert x == pytest.approx(fixed)
        assert side == "e" or abs(y) >= 0.5
        assert round(z, 2) == z
