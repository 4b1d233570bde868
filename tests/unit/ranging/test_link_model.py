from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.products import WallPieces
from slam_uwb.model.settings import RangingSettings
from slam_uwb.ranging import link_model
from slam_uwb.ranging.link_model import PRIORS, LinkParameters

MODEL = link_model(RangingSettings())
WALL = WallPieces(np.array([[(3.0, -5.0), (3.0, 5.0)]]), np.zeros(1), np.ones(1))
MAPPED = link_model(RangingSettings(), lambda _poses: WALL).at({})
TAGS, PLACES = np.zeros((2, 2)), np.array([(2.0, 0.0), (6.0, 0.0)])
SIGMAS = np.full(2, 0.1)


def believed(model, labels):
    return model.density(labels, SIGMAS).walls


def test_without_a_map_links_are_unlabelled_and_walls_poisson():
    labels = MODEL.labels(TAGS, PLACES)

    assert np.isnan(labels).all()
    walls = believed(MODEL, labels)
    # Mean 0.5, cut off after four walls: e^-0.5 = 0.6065, half of that for one wall.
    np.testing.assert_allclose(walls[0, :2], [0.6065, 0.3033], atol=2e-4)
    np.testing.assert_allclose(walls.sum(axis=1), 1.0)


def test_a_map_is_believed_but_not_blindly():
    walls = believed(MAPPED, MAPPED.labels(TAGS, PLACES))

    # Free by the map: 10 % cross a wall, seven of ten of them one. Behind one: 5 % do not.
    np.testing.assert_allclose(walls[0], [0.90, 0.07, 0.03, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(walls[1], [0.05, 0.95, 0.0, 0.0, 0.0], atol=1e-6)


def test_a_map_without_a_wall_is_no_map():
    nothing = WallPieces(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))
    model = link_model(RangingSettings(), lambda _poses: nothing).at({})

    assert np.isnan(model.labels(TAGS, PLACES)).all()


def test_a_clear_model_knows_no_walls():
    walls = believed(MAPPED.cleared(0.01), MAPPED.labels(TAGS, PLACES))

    np.testing.assert_array_equal(walls[:, 0], 1.0)
    assert MAPPED.cleared(0.01).anchor_sigma == 0.01


def test_a_link_that_is_less_certain_counts_less():
    weights = MODEL.density(MODEL.unlabelled(3), np.array([0.1, 0.2, np.inf])).weights

    np.testing.assert_allclose(weights, [1.0, 0.25, 0.0])


@pytest.mark.parametrize("name", sorted(PRIORS))
def test_priors_are_centred_on_the_defaults_and_turn_back(name):
    prior = PRIORS[name]

    assert prior.value(0.0) == pytest.approx(getattr(LinkParameters(), name))
    assert prior.deviation(prior.value(1.7)) == pytest.approx(1.7)


def test_fitting_finds_the_parameters_of_many_links():
    # 4000 errors drawn from the model's own densities; the prior hardly matters then.
    rng = np.random.default_rng(3)
    truth = replace(LinkParameters(), sight_sigma=0.07, wall_delay=0.6, hidden_share=0.2)
    labels = MAPPED.labels(
        np.zeros((4000, 2)), np.where(np.arange(4000)[:, None] % 2, (6, 0), (2, 0))
    )
    hidden = rng.random(4000) < np.where(labels[:, 0] > 0.5, 0.2, 0.95)
    count = np.where(hidden, 1 + ((labels[:, 0] > 0.5) & (rng.random(4000) < 0.3)), 0)
    delays = rng.gamma(1.3 * np.maximum(count, 1e-9), 0.6 / 1.3)
    errors = 0.07 * rng.standard_normal(4000) + delays
    errors += np.where((count == 0) & (rng.random(4000) < 0.08), rng.exponential(0.3, 4000), 0.0)
    sigmas = np.full(4000, 0.1)

    fitted, cost = MAPPED.fitted(lambda m: float(m.density(labels, sigmas).costs(errors).sum()))

    assert fitted.parameters.sight_sigma == pytest.approx(truth.sight_sigma, rel=0.05)
    assert fitted.parameters.wall_delay == pytest.approx(truth.wall_delay, rel=0.05)
    assert fitted.parameters.hidden_share == pytest.approx(truth.hidden_share, rel=0.2)
    assert fitted.parameters.mean_walls == LinkParameters().mean_walls
    assert cost <= float(MAPPED.density(labels, sigmas).costs(errors).sum())


def test_fitting_without_information_keeps_the_priors():
    fitted, cost = MAPPED.fitted(lambda _model: 0.0)

    for name in PRIORS:
        expected = getattr(LinkParameters(), name)
        assert getattr(fitted.parameters, name) == pytest.approx(expected)
    assert cost == pytest.approx(0.0)
