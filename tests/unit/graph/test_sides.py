from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.graph.range_fit import LEAST_CURVATURE, OffsetPrior, fit_ranges
from slam_uwb.graph.sides import PlaceCosts, likeliest_place, refined_place, side_at
from slam_uwb.graph.sightings import Sightings
from slam_uwb.model.products import WallPieces
from slam_uwb.model.settings import RangingSettings
from slam_uwb.model.survey import RangeOffset
from slam_uwb.ranging import link_model

OFFSET = RangeOffset(0.18, 0.10)
# A wall at x = 3, seen from the room at x < 3; the anchor hangs on it.
WALL = WallPieces(np.array([[(3.0, -6.0), (3.0, 6.0)]]), np.zeros(1), np.full(1, 0.97))
PLAIN = link_model(RangingSettings())
MAPPED = link_model(RangingSettings(), lambda _poses: WALL).at({})
ANCHOR = np.array([2.95, 1.0])
TAGS = np.array([(-3.0, 0.0), (-2.0, 3.0), (0.0, 1.5), (-1.0, -2.0), (1.0, -1.0)])


def sightings(too_long):
    rise = 1.1
    slant = np.sqrt(((ANCHOR - TAGS) ** 2).sum(axis=1) + rise**2)
    heights, sigmas = np.full(len(TAGS), 1.4), np.full(len(TAGS), 0.1)
    return Sightings(TAGS, heights, slant + OFFSET.mean + too_long, sigmas)


def costs_of(too_long, model=MAPPED):
    return PlaceCosts(sightings(too_long), 2.5, model, OFFSET.mean, 0.11)


def test_ranges_a_little_long_do_not_carry_an_anchor_through_its_wall():
    # All 0.3 m too long, as by a delay of its own: least squares is 0.2 to 0.3 m behind the wall. There all
    # five paths would cross it, and five walls in a row without a delay of 0.4 m are not likely.
    seen = sightings(0.3)
    view, prior = seen.times(1, 2.5), OffsetPrior(OFFSET, 0.05)
    free = np.zeros((1, len(TAGS), 5))
    free[..., 0] = 1.0
    density = MAPPED.density(free, view.sigmas)
    floor = LEAST_CURVATURE / MAPPED.sight_sigma**2
    through = fit_ranges(view, density, prior, ANCHOR[None], floor, coupled=False).places[0]

    costs = costs_of(0.3)
    place = refined_place(likeliest_place(through, costs), costs)

    assert through[0] > 3.1
    assert place[0] < 3.08
    assert side_at(place, costs).pull[0] < 0.0


def test_the_likeliest_place_is_a_minimum():
    costs = costs_of(np.array([0.3, 0.1, 0.2, 0.0, 0.4]))
    place = refined_place(likeliest_place(ANCHOR + 0.2, costs), costs)

    turns = np.linspace(0.0, 2.0 * np.pi, 9)
    around = place + 2e-3 * np.column_stack([np.cos(turns), np.sin(turns)])
    assert (costs(around) > costs(place[None])).all()


def test_the_gaussian_touches_what_the_labels_change():
    costs, place = costs_of(0.2), np.array([2.98, 0.9])

    side = side_at(place, costs)

    step = 1e-3 * np.eye(2)
    cells = np.vstack([place + step, place - step])
    changed = costs(cells) - costs(cells, labelled_at=place)
    slope = (changed[:2] - changed[2:]) / 2e-3
    # Of the differences over 2 cm.
    np.testing.assert_allclose(-side.curvature @ side.pull, slope, atol=0.05 * np.abs(slope).max())
    assert (np.linalg.eigvalsh(side.curvature) > 0.0).all()


@pytest.mark.parametrize("model", [PLAIN, MAPPED.cleared(0.05)])
def test_where_labels_do_not_change_nothing_pulls(model):
    side = side_at(ANCHOR, costs_of(0.2, model))

    np.testing.assert_allclose(side.pull, 0.0, atol=1e-6)
    np.testing.assert_allclose(side.curvature, 0.0, atol=1e-5)
