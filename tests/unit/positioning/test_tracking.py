"""The hybrid filter: against a re-computation by hand, exact without noise, alive whatever is missing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.settings import PositioningSettings
from slam_uwb.model.tag import Epoch, PowerLaw, ReceivedPower, TimeDifference
from slam_uwb.positioning import track_tag
from slam_uwb.positioning.measurement import measurement_of
from slam_uwb.positioning.start import start_place

ANCHORS = {
    "A": np.array([0.0, 0.0, 2.0]),
    "B": np.array([10.0, 0.0, 2.5]),
    "C": np.array([10.0, 8.0, 2.2]),
    "D": np.array([0.0, 8.0, 2.4]),
}
HEIGHT = 1.2
LAW = PowerLaw(-59.0, 2.5, 6.0)
SETTINGS = PositioningSettings()
NAN = math.nan


def distance(place, name):
    return float(np.linalg.norm([*(place - ANCHORS[name][:2]), HEIGHT - ANCHORS[name][2]]))


def epoch(time, place, names="BCD", powers="", noise=0.0, rng=None):
    """Exact differences against A, and exact powers."""

    def error():
        return 0.0 if rng is None else noise * rng.normal()

    differences = tuple(
        TimeDifference(n, "A", distance(place, n) - distance(place, "A") + error()) for n in names
    )
    heard = tuple(
        ReceivedPower(n, LAW.at_one_metre - 10 * LAW.exponent * math.log10(distance(place, n)))
        for n in powers
    )
    return Epoch(time, differences, heard)


def walk(count=40, dt=0.5):
    times = dt * np.arange(count)
    return times, np.column_stack([2.0 + 0.3 * times, 3.0 + 0.1 * times])


def recomputed(x, P, dt, z, R, h, acceleration):
    """One step of the scaled unscented filter, written out: van der Merwe (2004), alpha 0.5, beta 2, kappa 0."""
    n, alpha, beta = 4, 0.5, 2.0
    lam = alpha**2 * n - n
    wm = np.full(2 * n + 1, 0.5 / (n + lam))
    wc = wm.copy()
    wm[0], wc[0] = lam / (n + lam), lam / (n + lam) + 1.0 - alpha**2 + beta

    def points(mean, cov):
        root = np.linalg.cholesky((n + lam) * cov)
        return np.vstack([mean, (mean[:, None] + root).T, (mean[:, None] - root).T])

    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt
    g = np.array([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
    X = points(x, P) @ F.T
    x = wm @ X
    P = (X - x).T @ np.diag(wc) @ (X - x) + acceleration**2 * g @ g.T
    X = points(x, P)
    Z = np.array([h(p) for p in X])
    mean = wm @ Z
    S = (Z - mean).T @ np.diag(wc) @ (Z - mean) + R
    K = (X - x).T @ np.diag(wc) @ (Z - mean) @ np.linalg.inv(S)
    return x + K @ (z - mean), P - K @ S @ K.T


def test_one_step_is_the_scaled_unscented_filter():
    # The second epoch: time differences of B and C against A, and the power at B. Arrivals are independent
    # with sigma s, so the two differences share A's: variance 2 s^2 each (and 0.01 s^2 of their own), s^2 between.
    place = np.array([3.0, 4.0])
    first, second = epoch(0.0, place), epoch(0.5, np.array([3.3, 4.2]), "BC", "B")
    settings = SETTINGS.model_copy(update={"outlier_sigmas": 1e6})
    track = track_tag([first, second], ANCHORS, HEIGHT, settings, LAW)
    s2 = settings.arrival_sigma_m**2
    R = np.diag([2.01 * s2, 2.01 * s2, LAW.sigma**2])
    R[0, 1] = R[1, 0] = s2
    z = [d.difference for d in second.differences] + [second.powers[0].power]

    def h(state):
        a, b, c = (distance(state[:2], n) for n in "ABC")
        return [b - a, c - a, -59.0 - 25.0 * math.log10(b)]

    x, P = recomputed(
        track.states[0], track.covariances[0], 0.5, z, R, h, settings.acceleration_mps2
    )
    np.testing.assert_allclose(track.states[1], x, atol=1e-9)
    np.testing.assert_allclose(track.covariances[1], P, atol=1e-9)


def test_exact_measurements_give_the_exact_track():
    times, places = walk()
    epochs = [epoch(t, p, powers="AB") for t, p in zip(times, places, strict=True)]
    track = track_tag(epochs, ANCHORS, HEIGHT, SETTINGS, LAW)
    np.testing.assert_allclose(track.places[20:], places[20:], atol=0.02)
    np.testing.assert_allclose(track.states[20:, 2:], [[0.3, 0.1]] * 20, atol=0.02)


def test_errors_are_those_of_the_covariance():
    # 200 epochs of independent noise as the settings say; the place's NEES has 2 degrees of freedom, and
    # averages over hundreds of epochs of a slow tag correlate over about ten.
    rng = np.random.default_rng(4)
    times = 0.5 * np.arange(400)
    places = np.column_stack([5.0 + 3.0 * np.sin(times / 20), 4.0 + 2.0 * np.cos(times / 15)])
    shared = rng.normal(size=(400, 4)) * SETTINGS.arrival_sigma_m
    epochs = [
        Epoch(
            t,
            tuple(
                TimeDifference(n, "A", distance(p, n) - distance(p, "A") + e[k + 1] - e[0])
                for k, n in enumerate("BCD")
            ),
        )
        for t, p, e in zip(times, places, shared, strict=True)
    ]
    settings = SETTINGS.model_copy(update={"outlier_sigmas": 1e6, "acceleration_mps2": 0.1})
    track = track_tag(epochs, ANCHORS, HEIGHT, settings)
    errors = (track.places - places)[20:]
    blocks = track.covariances[20:, :2, :2]
    nees = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(blocks), errors)
    assert 0.8 < nees.mean() < 2.8


def test_steps_without_a_measurement_predict():
    times, places = walk()
    epochs = [
        epoch(t, p) if not 20 <= k < 24 else Epoch(t)
        for k, (t, p) in enumerate(zip(times, places, strict=True))
    ]
    track = track_tag(epochs, ANCHORS, HEIGHT, SETTINGS)
    assert list(track.used[19:25]) == [3, 0, 0, 0, 0, 3]
    np.testing.assert_allclose(track.places[23], track.places[19] + 2.0 * track.states[19, 2:])
    assert np.all(np.diff(track.covariances[19:24, 0, 0]) > 0.0)
    assert np.linalg.norm(track.places[-1] - places[-1]) < 0.05


def test_steps_with_one_value_and_with_nan_survive():
    times, places = walk()
    epochs = []
    for k, (t, p) in enumerate(zip(times, places, strict=True)):
        full = epoch(t, p, powers="C")
        one = replace(full, differences=full.differences[:1], powers=())
        power = replace(full, differences=())
        broken = Epoch(
            t, (TimeDifference("B", "A", NAN), *full.differences[1:]), (ReceivedPower("C", NAN),)
        )
        epochs.append([full, one, power, broken][k % 4])
    track = track_tag(epochs, ANCHORS, HEIGHT, SETTINGS, LAW)
    assert list(track.used[:4]) == [4, 1, 1, 2]
    assert np.isfinite(track.states).all()
    assert np.linalg.norm(track.places[30:] - places[30:], axis=1).max() < 0.2
    assert (np.linalg.eigvalsh(track.covariances) > 0.0).all()


def test_nothing_before_the_first_measurement_and_nothing_at_all():
    times, places = walk(6)
    epochs = [Epoch(times[0]), Epoch(times[1])]
    epochs += [epoch(t, p) for t, p in zip(times[2:], places[2:], strict=True)]
    track = track_tag(epochs, ANCHORS, HEIGHT, SETTINGS)
    assert np.isnan(track.states[:2]).all()
    assert np.isfinite(track.states[2:]).all()
    assert len(track_tag([], ANCHORS, HEIGHT, SETTINGS).times) == 0
    silent = track_tag([Epoch(0.0), Epoch(1.0)], ANCHORS, HEIGHT, SETTINGS)
    assert np.isnan(silent.states).all()
    nobody = track_tag([epoch(0.0, places[0])], {}, HEIGHT, SETTINGS)
    assert np.isnan(nobody.states).all()


def test_unknown_anchors_and_powers_without_a_law_are_left_out():
    place = np.array([4.0, 4.0])
    heard = epoch(0.0, place, "BCD", "AB")
    stranger = replace(heard, differences=(*heard.differences, TimeDifference("X", "A", 0.0)))
    assert track_tag([stranger], ANCHORS, HEIGHT, SETTINGS).used[0] == 3
    assert track_tag([stranger], ANCHORS, HEIGHT, SETTINGS, LAW).used[0] == 5


def test_an_outlier_counts_less():
    times, places = walk()
    epochs = [epoch(t, p) for t, p in zip(times, places, strict=True)]
    late = epochs[30].differences
    epochs[30] = Epoch(
        times[30], (replace(late[0], difference=late[0].difference + 4.0), *late[1:])
    )
    plain = SETTINGS.model_copy(update={"outlier_sigmas": 1e6})
    errors = [
        np.linalg.norm(track_tag(epochs, ANCHORS, HEIGHT, s).places[30] - places[30])
        for s in (SETTINGS, plain)
    ]
    # One step of re-weighting takes out nearly half.
    assert errors[0] < 0.6 * errors[1]


def test_moving_everything_moves_the_track():
    rng = np.random.default_rng(3)
    times, places = walk()
    epochs = [epoch(t, p, noise=0.1, rng=rng) for t, p in zip(times, places, strict=True)]
    shift = np.array([100.0, -50.0, 0.0])
    moved = {name: place + shift for name, place in ANCHORS.items()}
    here = track_tag(epochs, ANCHORS, HEIGHT, SETTINGS)
    there = track_tag(epochs, moved, HEIGHT, SETTINGS)
    np.testing.assert_allclose(there.places - shift[:2], here.places, atol=1e-6)


def test_time_must_not_run_backwards():
    with pytest.raises(ValueError, match="order of time"):
        track_tag([Epoch(1.0), Epoch(0.0)], ANCHORS, HEIGHT, SETTINGS)


def test_the_start_looks_everywhere_and_says_how_sure_it_is():
    place = np.array([8.0, 1.0])
    everywhere = np.array(list(ANCHORS.values()))

    def start(names, powers=""):
        seen = measurement_of(epoch(0.0, place, names, powers), ANCHORS, HEIGHT, LAW, 0.1)
        return start_place(seen, everywhere, SETTINGS)

    near, sure = start("BCD")
    assert np.linalg.norm(near - place) < SETTINGS.search_step_m
    # One difference leaves a hyperbola, one power a circle: the covariance spans the room.
    _, line = start("B")
    _, ring = start("", "B")
    assert np.trace(sure) < 1.0 < 5.0 < np.trace(line)
    assert np.trace(ring) > 5.0
