from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.graph.multilateration import fit_point, linear_multilateration
from slam_uwb.graph.sightings import Sightings
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.solution import Status

SETTINGS = GraphSettings()
ROOM = np.array([[0.0, 0.0], [4.0, 0.5], [7.5, 0.2], [7.0, 5.0], [3.5, 4.2], [0.5, 5.1]])
PLACE = np.array([9.0, 6.0])


def sight(points, place=PLACE, errors=0.0) -> Sightings:
    points = np.asarray(points, dtype=float)
    distances = np.sqrt(((points - place) ** 2).sum(axis=1) + 1.1**2) + errors
    return Sightings(points, np.full(len(points), 1.4), distances, np.full(len(points), 0.1))


def test_the_linear_start_is_exact_without_noise():
    linear = linear_multilateration(sight(ROOM), 2.5, 0.0)[0]

    np.testing.assert_allclose(linear, PLACE, atol=1e-9)


def test_points_in_line_start_on_both_sides():
    line = np.column_stack([np.arange(5.0), np.ones(5)])

    _, one, other = linear_multilateration(sight(line, (2.0, 4.0)), 2.5, 0.0)

    assert sorted([one[1], other[1]]) == pytest.approx([-2.0, 4.0])
    assert (one[0], other[0]) == pytest.approx((2.0, 2.0))


def test_the_fit_minimises_the_squares_of_equation_10():
    errors = np.array([0.4, -0.1, 0.9, 0.05, 0.0, 1.2])
    seen = sight(ROOM, errors=errors)

    finding, _ = fit_point(seen, 2.5, 0.0, SETTINGS)

    # At the minimum residuals are orthogonal to both derivatives of the ranges.
    delta = finding.place - ROOM
    slant = np.sqrt((delta**2).sum(axis=1) + 1.1**2)
    gradient = (delta / slant[:, None]).T @ (seen.distances - slant)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-6)


def test_nothing_robust_a_long_range_drags_the_fit():
    # The paper's own weakness, which the joint solver is there for.
    errors = np.array([0.0, 0.0, 3.0, 0.0, 0.0, 0.0])

    finding, _ = fit_point(sight(ROOM, errors=errors), 2.5, 0.0, SETTINGS)

    assert np.hypot(*(finding.place - PLACE)) > 0.3


def test_the_covariance_follows_the_residuals_and_not_below_the_links():
    # Residuals of zero do not make a place certain: 0.1 m a range, by the links.
    _, calm = fit_point(sight(ROOM), 2.5, 0.0, SETTINGS)
    _, rough = fit_point(
        sight(ROOM, errors=np.array([0.9, -0.9, 0.9, -0.9, 0.9, -0.9])), 2.5, 0.0, SETTINGS
    )

    delta = PLACE - ROOM
    directions = delta / np.sqrt((delta**2).sum(axis=1) + 1.1**2)[:, None]
    expected = 0.1**2 * np.linalg.inv(directions.T @ directions)
    np.testing.assert_allclose(calm, expected, rtol=1e-3)
    assert np.trace(rough) > 20.0 * np.trace(calm)


def test_a_stated_offset_is_subtracted():
    finding, _ = fit_point(sight(ROOM, errors=0.3), 2.5, 0.3, SETTINGS)

    np.testing.assert_allclose(finding.place, PLACE, atol=1e-8)


def test_too_few_and_in_line():
    few, no_covariance = fit_point(sight(ROOM[:2]), 2.5, 0.0, SETTINGS)
    line = np.column_stack([np.arange(5.0), np.ones(5)])
    twin, _ = fit_point(sight(line, (2.0, 4.0)), 2.5, 0.0, SETTINGS)

    assert (few.status, no_covariance) == (Status.UNREACHABLE, None)
    assert (twin.status, twin.place, len(twin.alternatives)) == (Status.MIRROR_AMBIGUOUS, None, 2)
