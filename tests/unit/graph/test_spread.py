from __future__ import annotations

import numpy as np

from slam_uwb.graph.sightings import Sightings
from slam_uwb.graph.spread import tail_covariance
from slam_uwb.model.products import WallPieces
from slam_uwb.model.settings import RangingSettings
from slam_uwb.model.survey import RangeOffset
from slam_uwb.ranging import link_model

PLACE = np.array([4.0, 3.0])
ROOM = np.array([[0.0, 0.0], [8.0, 0.5], [7.5, 6.2], [0.4, 5.8]])
OFFSET = RangeOffset(0.0, 1e-3)
MODEL = link_model(RangingSettings())
CLEAR = MODEL.cleared(0.05)


def sight(errors=0.0, points=ROOM) -> Sightings:
    count = len(points)
    distances = np.sqrt(((points - PLACE) ** 2).sum(axis=1) + 1.1**2) + errors
    return Sightings(points, np.full(count, 1.4), distances, np.full(count, 0.1))


def hessian_covariance(sigma=0.09, points=ROOM) -> np.ndarray:
    delta = PLACE - points
    directions = delta / np.sqrt((delta**2).sum(axis=1) + 1.1**2)[:, None]
    return sigma**2 * np.linalg.inv(directions.T @ directions)


def test_gaussian_errors_have_no_tails():
    covariance = hessian_covariance()

    extra = tail_covariance(PLACE, covariance, sight(), 2.5, OFFSET, CLEAR)

    assert np.linalg.norm(extra) < 0.1 * np.linalg.norm(covariance)


def test_ranges_that_may_be_long_have_tails():
    covariance = hessian_covariance()

    extra = tail_covariance(PLACE, covariance, sight(), 2.5, OFFSET, MODEL)

    assert np.linalg.eigvalsh(extra)[0] >= -1e-12
    assert np.trace(extra) > 0.1 * np.trace(covariance)


def test_a_place_that_few_ranges_hold_has_wider_tails():
    covariance = hessian_covariance()
    firm, loose = (
        tail_covariance(PLACE, covariance, sight(np.array(errors)), 2.5, OFFSET, MODEL)
        for errors in ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.5, 1.5])
    )

    assert np.trace(loose) > 2.0 * np.trace(firm)


def test_a_better_place_close_by_is_uncertainty():
    # Labels are held while a problem is solved. Judged by those of every place, 0.4 m further left,
    # on this side of the wall, explains the ranges at once: so far the estimate may be off.
    points = np.array([[0.0, 0.0], [0.0, 2.0], [0.0, 4.0], [0.0, 6.0]])
    wall = WallPieces(np.array([[(3.8, -9.0), (3.8, 9.0)]]), np.zeros(1), np.ones(1))
    walled = link_model(RangingSettings(), lambda _poses: wall).at({})
    there = PLACE - (0.4, 0.0)
    errors = np.hypot(*(points - there).T) - np.hypot(*(points - PLACE).T)

    extra = tail_covariance(PLACE, 0.05**2 * np.eye(2), sight(errors, points), 2.5, OFFSET, walled)

    assert 0.3**2 < extra[0, 0] < 0.5**2
    assert extra[1, 1] < 0.1**2


def test_nothing_seen_adds_nothing():
    nothing = Sightings(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))

    assert not tail_covariance(PLACE, np.eye(2), nothing, 2.5, OFFSET, MODEL).any()
