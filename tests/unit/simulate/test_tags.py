"""Simulated tags: the geometry behind the measurements, the same errors at the same place, the same bytes."""

import math

import numpy as np
import pytest

from slam_uwb.simulate import (
    Lidar,
    Radio,
    TagRadio,
    simulate_static_tags,
    simulate_survey,
    simulate_walk,
)
from slam_uwb.simulate.segments import clear_paths, distances_to_segments

QUIET = Lidar(duration=0.1, upper_duration=0.0)
PERFECT = TagRadio(synchronisation=0.0, power_fading=0.0, power_step=1e-6, power_budget=math.inf)


@pytest.fixture(scope="module")
def scene():
    return simulate_survey("paper-office", 5, lidar=QUIET).scene


def noise_free():
    radio = Radio.noise_free()
    return type(radio)(
        **{
            **{n: getattr(radio, n) for n in radio.__dataclass_fields__},
            "shadowing": 0.0,
            "wall_loss": 0.0,
        }
    )


def test_without_errors_differences_and_powers_are_those_of_the_distances(scene):
    made = simulate_static_tags(scene, 5, places=4, radio=noise_free(), tag_radio=PERFECT)
    heights = dict(zip(scene.anchor_ids, scene.anchors, strict=True))
    for stay in made.recording.stays:
        tag = np.array([*made.truth.places[stay.id], made.recording.tag_height])
        epochs = [e for e in made.recording.epochs if stay.start <= e.time < stay.end]
        assert len(epochs) == 30
        for item in epochs[0].differences:
            a, b = (np.linalg.norm(heights[n] - tag) for n in (item.anchor_a, item.anchor_b))
            assert item.difference == pytest.approx(a - b, abs=1e-9)
        assert len(epochs[0].differences) == 6
        for power in epochs[0].powers:
            reach = max(np.linalg.norm(heights[power.anchor] - tag), 1.0)
            assert power.power == pytest.approx(-59.0 - 20.0 * math.log10(reach), abs=1e-5)


def test_at_least_twenty_places_in_the_rooms_clear_of_walls(scene):
    made = simulate_static_tags(scene, 5)
    spots = np.array(list(made.truth.places.values()))
    assert len(spots) >= 20
    assert distances_to_segments(spots, scene.walls).min() > 0.4
    gaps = np.linalg.norm(spots[:, None] - spots, axis=-1) + 99.0 * np.eye(len(spots))
    assert gaps.min() > 0.5
    rooms = [
        [k for k, room in enumerate(scene.rooms) if np.all(p > room.min(0)) and np.all(p < room.max(0))]
        for p in spots
    ]  # fmt: skip
    assert {k for found in rooms for k in found} == {0, 1, 2, 3}


def test_the_walk_goes_through_doors_only_and_through_every_room(scene):
    made = simulate_walk(scene, 5)
    path = made.truth.path
    assert clear_paths(path[:-1], path[1:], scene.partitions).all()
    for room in scene.rooms:
        inside = (path > room.min(axis=0)) & (path < room.max(axis=0))
        assert inside.all(axis=1).any()
    assert 90.0 < made.recording.epochs[-1].time < 150.0
    assert not made.recording.stays


def test_errors_stay_where_the_tag_stays_and_walls_make_paths_longer(scene):
    # With no noise a call, all epochs of a stay are the same but for what was not heard.
    radio = TagRadio(synchronisation=0.0)
    made = simulate_static_tags(scene, 5, radio=Radio(jitter=0.0), tag_radio=radio)
    stay = made.recording.stays[0]
    by_pair = {}
    for epoch in made.recording.epochs:
        if stay.start <= epoch.time < stay.end:
            for item in epoch.differences:
                pair = (item.anchor_a, item.anchor_b)
                by_pair.setdefault(pair, []).append(item.difference)
    assert max(np.ptp(values) for values in by_pair.values()) < 1e-9


def test_the_same_seed_gives_the_same_recording_and_another_another(scene):
    assert simulate_walk(scene, 5).recording == simulate_walk(scene, 5).recording
    assert simulate_walk(scene, 6).recording != simulate_walk(scene, 5).recording
