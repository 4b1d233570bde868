from __future__ import annotations

import numpy as np

from slam_uwb.graph.sightings import Sightings
from slam_uwb.graph.spread import tail_covariance
from slam_uwb.model.survey import RangeOffset

PLACE = np.array([4.0, 3.0])
ROOM = np.array([[0.0, 0.0], [8.0, 0.5], [7.5, 6.2], [0.4, 5.8]])
OFFSET = RangeOffset(0.0, 1e-3)


def sight(errors) -> Sightings:
    distances = np.sqrt(((ROOM - PLACE) ** 2).sum(axis=1) + 1.1**2) + errors
    return Sightings(ROOM, np.full(4, 1.4), distances, np.full(4, 0.1))


def hessian_covariance() -> np.ndarray:
    delta = PLACE - ROOM
    directions = delta / np.sqrt((delta**2).sum(axis=1) + 1.1**2)[:, None]
    return 0.1**2 * np.linalg.inv(directions.T @ directions)


def test_without_a_robust_loss_there_are_no_tails():
    # A scale of 100 sigmas is a quadratic: its second moment is the inverse Hessian.
    covariance = hessian_covariance()

    extra = tail_covariance(PLACE, covariance, sight(np.zeros(4)), 2.5, OFFSET, scale=100.0)

    assert np.linalg.norm(extra) < 0.02 * np.linalg.norm(covariance)


def test_an_uncertain_offset_is_not_counted_where_the_graph_has_it_already():
    covariance = hessian_covariance()
    one_sided = tail_covariance(PLACE, covariance, sight(np.zeros(4)), 2.5, OFFSET, scale=1.0)

    assert np.linalg.eigvalsh(one_sided)[0] >= -1e-12
    # The loss lets go of long ranges: what lies that way is less certain than the Hessian says.
    assert np.trace(one_sided) > 0.1 * np.trace(covariance)


def test_a_place_that_few_ranges_hold_has_wider_tails():
    covariance = hessian_covariance()
    firm, loose = (
        tail_covariance(PLACE, covariance, sight(np.array(errors)), 2.5, OFFSET, scale=1.0)
        for errors in ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.5, 1.5])
    )

    assert np.trace(loose) > 2.0 * np.trace(firm)


def test_nothing_seen_adds_nothing():
    nothing = Sightings(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))

    assert not tail_covariance(PLACE, np.eye(2), nothing, 2.5, OFFSET, 1.0).any()
