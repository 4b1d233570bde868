"""Errors of what the anchors hear: each part alone, by the numbers that it was given."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.simulate import Lidar, Radio, TagRadio, simulate_survey
from slam_uwb.simulate.radio import Device
from slam_uwb.simulate.reception import receive

EXACT = TagRadio(synchronisation=0.0, power_fading=0.0, power_step=1e-9, power_budget=math.inf)
NOTHING = replace(Radio.noise_free(), shadowing=0.0)


@pytest.fixture(scope="module")
def scene():
    return simulate_survey("paper-office", 5, lidar=Lidar(duration=0.1, upper_duration=0.0)).scene


def hear(scene, tags, radio=NOTHING, steps=None, delay=0.0, tag_radio=EXACT, seed=0):
    """Arrivals less the true distances (N, A), powers and walls."""
    count = len(scene.anchors)
    devices = [Device(delay * a, 0.0) for a in range(count)]
    steps = np.full(len(tags), np.inf) if steps is None else steps
    rngs = [np.random.default_rng([seed, a]) for a in range(count)]
    heard = receive(scene, tags, steps, devices, radio, tag_radio, rngs)
    distances = np.linalg.norm(tags[:, None] - scene.anchors, axis=-1)
    return heard.arrivals - distances, heard.powers, heard.walls


def places(scene, count, seed=1):
    rng = np.random.default_rng(seed)
    low, high = scene.walls.min(axis=(0, 1)) + 0.5, scene.walls.max(axis=(0, 1)) - 0.5
    return np.column_stack([rng.uniform(low, high, (count, 2)), np.full(count, 1.2)])


def test_without_errors_an_arrival_is_the_distance(scene):
    errors, _, _ = hear(scene, places(scene, 50))
    np.testing.assert_allclose(errors, 0.0, atol=1e-12)


def test_an_anchor_adds_its_own_delay(scene):
    errors, _, _ = hear(scene, places(scene, 5), delay=0.1)
    expected = np.broadcast_to(0.1 * np.arange(len(scene.anchors)), errors.shape)
    np.testing.assert_allclose(errors, expected, atol=1e-12)


def test_walls_make_paths_longer_by_what_they_are_given(scene):
    radio = replace(NOTHING, wall_delay=0.4)
    means = []
    for seed in range(40):
        errors, _, walls = hear(scene, places(scene, 100), radio, seed=seed)
        np.testing.assert_allclose(errors[walls == 0], 0.0, atol=1e-12)
        assert (errors[walls > 0] > 0.0).all()
        means.append(errors.sum() / walls.sum())
    # 0.4 m a wall in the mean; 40 drawings of some thirty walls and anchors each.
    assert np.mean(means) == pytest.approx(0.4, rel=0.1)


def test_whoever_comes_back_meets_the_same_wall(scene):
    tags = np.tile(places(scene, 3), (2, 1))
    errors, _, _ = hear(scene, tags, replace(NOTHING, wall_delay=0.4, furniture_delay=0.2))
    np.testing.assert_array_equal(errors[:3], errors[3:])


def test_multipath_stays_nearby_and_forgets_further_on(scene):
    # Steps of 0.1 m and a length of 0.5 m: neighbours correlate by exp(-0.2), those 10 steps on by exp(-2).
    radio = replace(NOTHING, link_sigma=0.07)
    tags = np.tile(places(scene, 1), (4000, 1))
    errors, _, _ = hear(scene, tags, radio, steps=np.full(4000, 0.1))
    assert np.std(errors) == pytest.approx(0.07, rel=0.1)
    for lag in (1, 10):
        found = np.mean(errors[lag:] * errors[:-lag]) / np.var(errors)
        assert found == pytest.approx(math.exp(-0.2 * lag), abs=0.08)


def test_powers_fall_with_distance_and_walls(scene):
    tags = places(scene, 50)
    _, powers, walls = hear(scene, tags, replace(NOTHING, wall_loss=7.0))
    reach = np.maximum(np.linalg.norm(tags[:, None] - scene.anchors, axis=-1), 1.0)
    np.testing.assert_allclose(powers, -59.0 - 20.0 * np.log10(reach) - 7.0 * walls, atol=1e-6)


def test_what_is_too_weak_is_not_heard(scene):
    radio = replace(NOTHING, wall_loss=10.0, budget=35.0)
    errors, powers, walls = hear(
        scene, places(scene, 100), radio, tag_radio=replace(EXACT, power_budget=20.0)
    )
    assert np.isnan(errors[walls >= 3]).all()
    assert np.isfinite(errors[walls == 0]).mean() > 0.9
    assert np.isnan(powers[walls >= 2]).all()
