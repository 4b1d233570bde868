"""A scene and a seed -> the survey an operator would bring home, and the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.survey import (
    Anchor,
    AnchorId,
    RangeSamples,
    Reference,
    ReferencePlace,
    Station,
    StationId,
    Survey,
    TwoWayPeriods,
)
from .catalogue import build_scene
from .lidar import Lidar, record_scan
from .radio import (
    Device,
    LinkTruth,
    Radio,
    count_exchanges,
    draw_device,
    draw_link,
    sample_periods,
    sample_ranges,
)
from .scene import Scene
from .streams import Stream, stream


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A survey with everything that is true about it."""

    survey: Survey
    reference: Reference
    scene: Scene
    link_truth: dict[tuple[StationId, AnchorId], tuple[int, float]]
    """Walls crossed and constant error in m of every link, those never heard included."""


def simulate_survey(
    scene: str | Scene,
    seed: int,
    *,
    lidar: Lidar = Lidar(),  # noqa: B008  frozen
    radio: Radio = Radio(),  # noqa: B008  frozen
    two_way: bool = False,
    sequence: bool = True,
) -> Simulation:
    """Visit every station of a scene once and record.

    Args:
        scene: a name of `SCENES`, `random-floor-N`, or a scene of your own.
        seed: the same seed gives the same survey, to the last bit.
        lidar: scanner, its errors and the length of its recordings.
        radio: transceivers, propagation and the length of their recordings.
        two_way: periods of exchanges in place of distances.
        sequence: whether the operator says which scan fits which.

    Returns:
        The survey, named `<scene>-<seed>`, and its truth in the frame of the plan; SlamUwbError where the
        scene's name is unknown.
    """
    site = build_scene(scene, stream(seed, Stream.SCENE)) if isinstance(scene, str) else scene
    visits = [_visit(site, k, lidar, radio, seed) for k in range(len(site.stations))]
    poses = [pose for pose, _ in visits]
    links, recordings = _record_links(site, poses, radio, seed, two_way)
    ids = site.station_ids
    survey = Survey(
        name=f"{site.name}-{seed}",
        stations=tuple(station for _, station in visits),
        anchors=tuple(map(Anchor, site.anchor_ids, site.anchors[:, 2].tolist())),
        ranges=tuple(r for r in recordings if isinstance(r, RangeSamples)),
        periods=tuple(r for r in recordings if isinstance(r, TwoWayPeriods)),
        sequence=tuple((ids[m], ids[n]) for m, n in site.sequence) if sequence else None,
        tag_offset=radio.tag_offset,
    )
    truth = {link: (found.walls, found.error) for link, found in links.items()}
    return Simulation(survey, _reference(site, poses), site, truth)


def _visit(scene: Scene, k: int, lidar: Lidar, radio: Radio, seed: int) -> tuple[Pose2, Station]:
    """Station number `k`: its pose and its scans, each with a heading of its own."""
    rng = stream(seed, Stream.STATION, k)
    x, y = (float(v) for v in scene.stations[k])
    pose, raised = (Pose2(x, y, theta) for theta in rng.uniform(-np.pi, np.pi, 2))
    has_upper = lidar.upper_duration > 0
    station = Station(
        id=scene.station_ids[k],
        scan=record_scan(scene, pose, lidar.height, lidar.duration, lidar, rng),
        tag_height=radio.tag_height,
        upper_scan=record_scan(scene, raised, lidar.upper_height, lidar.upper_duration, lidar, rng)
        if has_upper
        else None,
        upper_scan_height=lidar.upper_height if has_upper else None,
    )
    return pose, station


def _record_links(
    scene: Scene, poses: list[Pose2], radio: Radio, seed: int, two_way: bool
) -> tuple[dict[tuple[StationId, AnchorId], LinkTruth], list[RangeSamples | TwoWayPeriods]]:
    """All links and what was heard of them, station by station."""
    tag_device = draw_device(radio, stream(seed, Stream.TAG))
    devices = [
        draw_device(radio, stream(seed, Stream.ANCHOR, a)) for a in range(len(scene.anchors))
    ]
    truths: dict[tuple[StationId, AnchorId], LinkTruth] = {}
    heard: list[RangeSamples | TwoWayPeriods] = []
    for s, pose in enumerate(poses):
        tag = np.append(pose.transform(np.array(radio.tag_offset)), radio.tag_height)
        links = [
            draw_link(scene, tag, scene.anchors[a], device, radio, stream(seed, Stream.LINK, s, a))
            for a, device in enumerate(devices)
        ]
        tries = count_exchanges(links, radio)
        for a, (link, device) in enumerate(zip(links, devices, strict=True)):
            name = (scene.station_ids[s], scene.anchor_ids[a])
            truths[name] = link
            rng = stream(seed, Stream.SAMPLES, s, a)
            heard += _record_link(
                name, link, tries, (tag_device, device) if two_way else None, radio, rng
            )
    return truths, heard


def _record_link(
    name: tuple[StationId, AnchorId],
    link: LinkTruth,
    tries: int,
    clocks: tuple[Device, Device] | None,
    radio: Radio,
    rng: np.random.Generator,
) -> list[RangeSamples | TwoWayPeriods]:
    """The recording of one link; none where nothing came through."""
    samples: FloatArray
    if clocks is None:
        samples = sample_ranges(link, tries, radio, rng)
        return [RangeSamples(*name, samples)] if len(samples) else []
    samples = sample_periods(link, tries, *clocks, radio, rng)
    return [TwoWayPeriods(*name, samples)] if len(samples) else []


def _reference(scene: Scene, poses: list[Pose2]) -> Reference:
    stations = {
        station: ReferencePlace(pose.x, pose.y, pose.theta)
        for station, pose in zip(scene.station_ids, poses, strict=True)
    }
    anchors = {
        anchor: ReferencePlace(float(x), float(y))
        for anchor, (x, y, _) in zip(scene.anchor_ids, scene.anchors, strict=True)
    }
    return Reference(stations, anchors)
