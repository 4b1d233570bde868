from __future__ import annotations

import numpy as np
import pytest

from slam_uwb.graph.range_fit import (
    OffsetPrior,
    RangeView,
    common_sigma,
    fit_ranges,
    log_evidence_cost,
)
from slam_uwb.model.settings import RangingSettings
from slam_uwb.model.survey import RangeOffset
from slam_uwb.ranging import link_model

MODEL = link_model(RangingSettings())
CLEAR = MODEL.cleared(0.05)
PRIOR = OffsetPrior(RangeOffset(0.18, 0.10), 0.05)
FLOOR = 0.02 / 0.09**2
STATIONS = np.array([[0.0, 0.0], [6.0, 0.5], [7.0, 5.0], [0.5, 6.0], [3.0, 2.5]])
PLACES = np.array([[8.0, 3.0], [-1.0, 2.0], [4.0, 7.0]])


def view(offset=0.18, errors=0.0, places=PLACES) -> RangeView:
    points = np.broadcast_to(STATIONS, (len(places), 5, 2))
    rises = np.full((len(places), 5), 1.1)
    slant = np.sqrt(((places[:, None] - points) ** 2).sum(axis=2) + rises**2)
    return RangeView(points, rises, slant + offset + errors, np.full(rises.shape, 0.1))


def fit(seen, model=CLEAR, start=PLACES + 0.2, coupled=True, prior=PRIOR):
    density = model.density(model.unlabelled(*seen.distances.shape), seen.sigmas)
    return fit_ranges(seen, density, prior, start, FLOOR, coupled), density


def cost_of(seen, density, prior, places, offsets, common):
    residuals, _ = seen.residuals(places, offsets)
    own = 0.5 * ((offsets - common) / prior.own_sigma) ** 2
    shared = 0.5 * ((common - prior.common.mean) / prior.common.sigma) ** 2
    return density.costs(residuals).sum() + own.sum() + shared


def test_exact_ranges_give_exact_places():
    found, _ = fit(view())

    np.testing.assert_allclose(found.places, PLACES, atol=2e-4)
    np.testing.assert_allclose(found.offsets, 0.18, atol=2e-4)


@pytest.mark.parametrize("model", [MODEL, CLEAR])
def test_the_fit_is_a_minimum_over_places_offsets_and_the_common_one(model):
    seen = view(errors=0.15 * np.random.default_rng(1).standard_normal((3, 5)) ** 2)

    found, density = fit(seen, model)

    best = cost_of(seen, density, PRIOR, found.places, found.offsets, found.common)
    for step in (2e-3, -2e-3):
        for k in range(3):
            for axis in range(2):
                moved = found.places.copy()
                moved[k, axis] += step
                args = (moved, found.offsets, found.common)
                assert cost_of(seen, density, PRIOR, *args) > best
        longer = found.offsets + step
        assert cost_of(seen, density, PRIOR, found.places, longer, found.common) > best
        common = found.common + step
        assert cost_of(seen, density, PRIOR, found.places, found.offsets, common) > best


def test_points_that_are_not_coupled_do_not_know_of_each_other():
    errors = np.zeros((3, 5))
    together, _ = fit(view(), coupled=False)
    errors[2] += 0.4

    other, _ = fit(view(errors=errors), coupled=False)

    np.testing.assert_allclose(other.places[:2], together.places[:2], atol=1e-9)


def test_padding_counts_nothing():
    seen = view()
    padded = RangeView(
        np.concatenate([seen.points, np.zeros((3, 2, 2))], axis=1),
        np.pad(seen.rises, ((0, 0), (0, 2))),
        np.pad(seen.distances, ((0, 0), (0, 2)), constant_values=99.0),
        np.pad(seen.sigmas, ((0, 0), (0, 2)), constant_values=np.inf),
    )

    (plain, _), (with_padding, _) = fit(seen), fit(padded)

    np.testing.assert_allclose(with_padding.places, plain.places, atol=1e-9)
    np.testing.assert_allclose(with_padding.blocks, plain.blocks, rtol=1e-9)


def test_the_evidence_is_the_integral_over_the_places_and_offsets():
    # One anchor: place and both offsets integrated on a grid about the minimum. All Gaussian, so
    # Laplace is exact up to the faults and the bend of the circles.
    seen = view(errors=np.array([[0.05, -0.1, 0.02, 0.08, -0.03]]), places=PLACES[:1])
    costs = {}
    for own_sigma in (0.02, 0.05):
        prior = OffsetPrior(PRIOR.common, own_sigma)
        found, _ = fit(seen, start=PLACES[:1], prior=prior)
        # Given the anchor's own offset, the common one integrates to a Gaussian of both variances.
        sigma = np.hypot(own_sigma, 0.10)
        axes = [
            np.linspace(-6.0, 6.0, 25) * spread
            for spread in np.linalg.inv(found.blocks[0]).diagonal() ** 0.5 * 2
        ]
        x, y, b = np.meshgrid(*axes, indexing="ij")
        places = found.places[0] + np.stack([x.ravel(), y.ravel()], axis=1)
        offsets = found.offsets[0] + b.ravel()
        parts = (seen.points, seen.rises, seen.distances, seen.sigmas)
        many = RangeView(*(np.repeat(part, len(places), axis=0) for part in parts))
        residuals, _ = many.residuals(places, offsets)
        exponent = (
            CLEAR.density(CLEAR.unlabelled(len(places), 5), many.sigmas)
            .costs(residuals)
            .sum(axis=1)
        )
        exponent += 0.5 * ((offsets - 0.18) / sigma) ** 2 + np.log(sigma)
        cell = np.prod([axis[1] - axis[0] for axis in axes])
        numeric = -np.log(np.exp(-exponent).sum() * cell)
        costs[own_sigma] = log_evidence_cost(found, prior) - numeric
    # Up to one constant: the powers of 2 pi.
    assert costs[0.02] == pytest.approx(costs[0.05], abs=0.02)


def test_the_common_offset_is_identified_by_many_anchors_and_not_by_one():
    # From one side of a room an offset and a distance are one; the prior's 0.10 m remains.
    row = np.array([[0.0, 0.0], [0.0, 0.5], [0.0, 1.0], [0.0, 1.5], [0.0, 2.0]])
    far = np.array([[30.0, 1.0]])
    slant = np.sqrt(((far[:, None] - row) ** 2).sum(axis=2))
    weak = RangeView(row[None], np.zeros((1, 5)), slant + 0.18, np.full((1, 5), 0.1))

    (loose, _), (firm, _) = fit(weak, start=far), fit(view())

    assert common_sigma(loose, PRIOR) > 0.095
    assert common_sigma(firm, PRIOR) < 0.065


def test_wherever_a_point_starts_its_fit_ends_where_the_cost_is_flat():
    # Two ranges too long, as through walls: valleys and saddles between them, along which steps that
    # only ever trust positive curvatures creep.
    x, y = np.meshgrid(np.linspace(-3.0, 10.0, 12), np.linspace(-3.0, 9.0, 12))
    starts = np.column_stack([x.ravel(), y.ravel()])
    seen = view(errors=np.array([0.0, 0.9, 0.1, 1.4, 0.0]), places=PLACES[[0] * len(starts)])

    found, density = fit(seen, MODEL, starts, coupled=False)

    slopes = np.zeros((len(starts), 2))
    for axis in range(2):
        for side in (1e-5, -1e-5):
            moved = found.places.copy()
            moved[:, axis] += side
            residuals, _ = seen.residuals(moved, found.offsets)
            slopes[:, axis] += density.costs(residuals).sum(axis=1) / (2.0 * side)
    share = float((np.abs(slopes).max(axis=1) < 1e-3).mean())
    assert share > 0.97
