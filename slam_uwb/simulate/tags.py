"""The paper's second experiment in a simulated scene: static tags at many places, and a person who walks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Points
from ..model.survey import AnchorId
from ..model.tag import (
    Epoch,
    PowerLaw,
    ReceivedPower,
    Stay,
    TagRecording,
    TagTruth,
    TimeDifference,
)
from .radio import Radio, draw_device
from .reception import Reception, TagRadio, receive
from .scene import Scene
from .segments import distances_to_segments
from .streams import Stream, stream

PLACES = 24
STAY_S = 15.0
SPEED = 0.6
"""m/s, a person who strolls: about two minutes for the round of an office."""
TAG_HEIGHT = 1.2
"""m above the floor: on the chest, or on a desk with something under it."""
CLEARANCE = 0.4
"""m between a static tag and the walls."""
CALIBRATED = PowerLaw(-59.0, 3.0, 8.0)
"""What an installer takes from tables: one metre by the data sheet, offices about 3, walls in the sigma."""
_CANDIDATES = 40


@dataclass(frozen=True, slots=True, eq=False)
class TagSimulation:
    """A recording and its truth, in the frame of the scene's plan."""

    recording: TagRecording
    truth: TagTruth


def simulate_static_tags(
    scene: Scene,
    seed: int,
    *,
    places: int = PLACES,
    radio: Radio = Radio(),  # noqa: B008  frozen
    tag_radio: TagRadio = TagRadio(),  # noqa: B008  frozen
) -> TagSimulation:
    """A tag laid at places spread over all rooms, one after the other.

    Args:
        scene: of a survey simulated with the same seed, whose anchors these are.
        seed: the anchors' own delays are those of that survey.
        places: how many.
        radio: propagation.
        tag_radio: the tag.
    """
    spots = _spread(scene, places, stream(seed, Stream.STAYS))
    calls = round(STAY_S * tag_radio.rate)
    tags = np.repeat(spots, calls, axis=0)
    steps = np.zeros(len(tags))
    steps[::calls] = np.inf
    times = np.arange(len(tags)) / tag_radio.rate
    heard = _receive(scene, seed, tags, steps, Stream.STAY_RECEPTION, radio, tag_radio)
    stays = tuple(
        Stay(f"p{k + 1:02d}", float(times[k * calls]), float(times[k * calls]) + STAY_S)
        for k in range(places)
    )
    truth = {stay.id: spot for stay, spot in zip(stays, spots, strict=True)}
    name = f"{scene.name}-{seed}-static"
    return TagSimulation(_recording(name, scene, times, heard, stays), TagTruth(truth))


def simulate_walk(
    scene: Scene,
    seed: int,
    *,
    radio: Radio = Radio(),  # noqa: B008  frozen
    tag_radio: TagRadio = TagRadio(),  # noqa: B008  frozen
) -> TagSimulation:
    """A person who walks the tripod's round and back: through every room, about two minutes in an office.

    The legs between consecutive stations are free of walls and furniture by the scene's own making.
    """
    path = _round(scene)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    walked = np.arange(0.0, along[-1], SPEED / tag_radio.rate)
    tags = np.column_stack([np.interp(walked, along, path[:, k]) for k in (0, 1)])
    steps = np.concatenate([[np.inf], np.diff(walked)])
    heard = _receive(scene, seed, tags, steps, Stream.WALK_RECEPTION, radio, tag_radio)
    times = np.arange(len(tags)) / tag_radio.rate
    recording = _recording(f"{scene.name}-{seed}-walk", scene, times, heard, ())
    return TagSimulation(recording, TagTruth({}, path))


def _receive(
    scene: Scene,
    seed: int,
    places: Points,
    steps: FloatArray,
    kind: Stream,
    radio: Radio,
    tag_radio: TagRadio,
) -> Reception:
    anchors = range(len(scene.anchors))
    # The anchors are those of the survey: what their electronics add, they add here too.
    devices = [draw_device(radio, stream(seed, Stream.ANCHOR, a)) for a in anchors]
    tags = np.column_stack([places, np.full(len(places), TAG_HEIGHT)])
    rngs = [stream(seed, kind, a) for a in anchors]
    return receive(scene, tags, steps, devices, radio, tag_radio, rngs)


def _recording(
    name: str, scene: Scene, times: FloatArray, heard: Reception, stays: tuple[Stay, ...]
) -> TagRecording:
    epochs = tuple(
        _epoch(float(time), arrivals, powers, scene.anchor_ids)
        for time, arrivals, powers in zip(times, heard.arrivals, heard.powers, strict=True)
    )
    heights = dict(zip(scene.anchor_ids, scene.anchors[:, 2].tolist(), strict=True))
    return TagRecording(name, TAG_HEIGHT, epochs, stays, CALIBRATED, heights)


def _epoch(
    time: float, arrivals: FloatArray, powers: FloatArray, names: tuple[AnchorId, ...]
) -> Epoch:
    """Differences against the anchor that hears the tag best: of those that heard it, the strongest."""
    on_time = np.flatnonzero(np.isfinite(arrivals))
    differences: tuple[TimeDifference, ...] = ()
    if len(on_time) > 1:
        strength = np.where(np.isfinite(powers), powers, -np.inf)
        best = int(on_time[np.argmax(strength[on_time])])
        differences = tuple(
            TimeDifference(names[a], names[best], float(arrivals[a] - arrivals[best]))
            for a in on_time.tolist()
            if a != best
        )
    loud = np.flatnonzero(np.isfinite(powers)).tolist()
    return Epoch(time, differences, tuple(ReceivedPower(names[a], float(powers[a])) for a in loud))


def _round(scene: Scene) -> Points:
    """(N, 2) m, corners of the way along the sequence and back to its start."""
    following: dict[int, list[int]] = {}
    for m, n in scene.sequence:
        following.setdefault(m, []).append(n)
    order = [0]

    def visit(here: int) -> None:
        for onward in following.get(here, ()):
            order.append(onward)
            visit(onward)
            order.append(here)

    visit(0)
    return scene.stations[order]


def _spread(scene: Scene, count: int, rng: np.random.Generator) -> Points:
    """(count, 2) m in the rooms by area, clear of walls, each far from the others (best of some candidates)."""
    areas = np.array([_area(room) for room in scene.rooms])
    chosen: list[FloatArray] = []
    while len(chosen) < count:
        room = scene.rooms[rng.choice(len(areas), p=areas / areas.sum())]
        drawn = rng.uniform(room.min(axis=0), room.max(axis=0), (_CANDIDATES, 2))
        clear = distances_to_segments(drawn, scene.walls).min(axis=1) > CLEARANCE
        drawn = drawn[clear & _inside(drawn, room)]
        if not len(drawn):
            continue
        gaps = (
            np.linalg.norm(drawn[:, None] - np.array(chosen), axis=-1).min(axis=1)
            if chosen
            else np.zeros(len(drawn))
        )
        chosen.append(drawn[np.argmax(gaps)])
    return np.array(chosen)


def _area(polygon: Points) -> float:
    after = np.roll(polygon, -1, axis=0)
    return float(abs(np.sum(polygon[:, 0] * after[:, 1] - polygon[:, 1] * after[:, 0])) / 2.0)


def _inside(points: Points, polygon: Points) -> FloatArray:
    """(N,) True inside the polygon: a ray to the right crosses its sides an odd number of times."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    between = (start[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = start[:, 0] + (y - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end[:, 0] - start[:, 0])
    return np.asarray((between & (x < at)).sum(axis=1) % 2 == 1)
