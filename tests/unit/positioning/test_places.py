"""Static tags: each by a filter of its own, its mean after settling."""

import numpy as np

from slam_uwb.model.settings import PositioningSettings
from slam_uwb.model.tag import Epoch, Stay, TagRecording, TimeDifference
from slam_uwb.positioning import locate_stays, track_tag

ANCHORS = {
    name: np.array([x, y, 2.0])
    for name, x, y in (("A", 0, 0), ("B", 9, 0), ("C", 9, 7), ("D", 0, 7))
}
SETTINGS = PositioningSettings()
PLACES = {"p1": np.array([2.0, 2.0]), "p2": np.array([7.0, 5.0])}


def epochs(place, start, rng):
    reach = {n: np.hypot(np.linalg.norm(place - a[:2]), 1.0) for n, a in ANCHORS.items()}
    return [
        Epoch(
            start + k,
            tuple(
                TimeDifference(n, "A", reach[n] - reach["A"] + 0.05 * rng.normal()) for n in "BCD"
            ),
        )
        for k in range(10)
    ]


def recording():
    rng = np.random.default_rng(0)
    heard = [e for k, place in enumerate(PLACES.values()) for e in epochs(place, 10.0 * k, rng)]
    stays = (Stay("p1", 0.0, 10.0), Stay("p2", 10.0, 20.0), Stay("p3", 20.0, 30.0))
    return TagRecording("r", 1.0, tuple(heard), stays)


def test_each_place_is_found_and_an_unheard_one_is_empty():
    first, second, third = locate_stays(recording(), ANCHORS, SETTINGS)
    assert np.linalg.norm(first.position - PLACES["p1"]) < 0.1
    assert np.linalg.norm(second.position - PLACES["p2"]) < 0.1
    assert (third.id, third.position, third.covariance, third.epochs) == ("p3", None, None, 0)


def test_it_is_the_mean_after_settling():
    first, _, _ = locate_stays(recording(), ANCHORS, SETTINGS)
    alone = [e for e in recording().epochs if e.time < 10.0]
    track = track_tag(alone, ANCHORS, 1.0, SETTINGS)
    # Epochs at 0, 1, ..., 9 s; those from 3 s on have settled.
    assert first.epochs == 7
    np.testing.assert_allclose(first.position, track.places[3:].mean(axis=0))


def test_a_stay_shorter_than_settling_has_its_last_place():
    short = SETTINGS.model_copy(update={"settling_s": 60.0})
    first, _, _ = locate_stays(recording(), ANCHORS, short)
    assert first.epochs == 1
    assert np.linalg.norm(first.position - PLACES["p1"]) < 0.2
