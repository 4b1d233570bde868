import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam_uwb.io.degrees import degrees_from_radians, radians_from_degrees

angles = st.floats(-1e4, 1e4)


@pytest.mark.parametrize(
    ("degrees", "radians"),
    [
        (0, 0),
        (180, math.pi),
        (-180, math.pi),
        (540, math.pi),
        (359, -math.pi / 180),
        (-270, math.pi / 2),
    ],
)
def test_known_angles(degrees, radians):
    assert radians_from_degrees(degrees) == pytest.approx(radians, abs=1e-15)


@settings(deadline=None)
@given(angles)
def test_radians_are_in_the_half_open_turn(degrees):
    radians = float(radians_from_degrees(degrees))
    assert -math.pi < radians <= math.pi
    assert math.cos(radians) == pytest.approx(math.cos(math.radians(degrees)), abs=1e-11)


@settings(deadline=None)
@given(angles)
def test_what_came_from_degrees_returns_bit_by_bit(degrees):
    radians = radians_from_degrees(degrees)
    assert radians_from_degrees(degrees_from_radians(radians)) == radians


@settings(deadline=None)
@given(st.floats(-math.pi, math.pi, exclude_min=True))
def test_any_radians_return_within_one_last_place(radians):
    back = float(radians_from_degrees(degrees_from_radians(radians)))
    assert abs(back - radians) <= math.ulp(radians)


def test_nan_stays_nan():
    assert np.isnan(radians_from_degrees(math.nan))
    assert np.isnan(degrees_from_radians(math.nan))
