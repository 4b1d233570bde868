from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import AnchorLink, GraphProblem, LinkMeasurement, ScanMatch
from slam_uwb.model.settings import RangingSettings
from slam_uwb.model.survey import Anchor, KnownPlace, RangeOffset, Scan, Station
from slam_uwb.ranging import link_model

TAG_HEIGHT = 1.4
NO_SCAN = Scan(np.zeros(0), np.zeros(0), 10.0)
MATCH_SIGMAS = np.array([0.01, 0.01, math.radians(0.2)])

# Twelve stations over 10 m x 6 m, no three in line, and anchors on the walls round them.
STATIONS = {
    f"s{k:02d}": Pose2(x, y, theta)
    for k, (x, y, theta) in enumerate(
        [
            (1.0, 1.2, 0.3), (3.1, 0.8, 2.1), (5.2, 1.5, -1.0), (7.4, 0.9, 3.0), (9.1, 1.8, 0.0),
            (8.8, 4.1, -2.4), (6.9, 5.2, 1.7), (4.8, 4.6, 0.8), (2.7, 5.3, -0.4), (1.2, 4.2, 2.8),
            (3.6, 2.9, 1.1), (6.1, 3.2, -1.9),
        ],
        start=1,
    )
}  # fmt: skip
ANCHORS = {
    "A1": (0.0, 0.0, 2.6), "A2": (10.0, 0.2, 2.4), "A3": (9.8, 6.0, 2.8),
    "A4": (0.1, 6.1, 2.5), "A5": (5.0, 6.2, 2.1),
}  # fmt: skip


@dataclass
class Scene:
    """A survey whose truth is known; every part can be changed before `problem`."""

    stations: dict[str, Pose2] = field(default_factory=lambda: dict(STATIONS))
    anchors: dict[str, tuple[float, float, float]] = field(default_factory=lambda: dict(ANCHORS))
    known_stations: dict[str, KnownPlace] = field(default_factory=dict)
    known_anchors: dict[str, KnownPlace] = field(default_factory=dict)
    unmeasured: set[str] = field(default_factory=set)
    """Anchors without height."""
    no_scan: set[str] = field(default_factory=set)
    tag_heights: dict[str, float] = field(default_factory=dict)
    lever: tuple[float, float] = (0.0, 0.0)
    range_offset: RangeOffset | None = field(default_factory=lambda: RangeOffset(0.0, 0.05))
    true_offset: float = 0.0
    max_pair: float = 3.5
    deaf: set[tuple[str, str]] = field(default_factory=set)
    """Links that do not exist."""
    anchor_pairs: tuple[tuple[str, str], ...] = ()
    sequence: tuple[tuple[str, str], ...] | None = None
    match_noise: float = 0.0
    range_noise: float = 0.0
    long_ranges: dict[tuple[str, str], float] = field(default_factory=dict)
    seed: int = 0

    def pairs(self) -> list[tuple[str, str]]:
        names = [n for n in self.stations if n not in self.no_scan]
        return [
            (a, b)
            for i, a in enumerate(names)
            for b in names[i + 1 :]
            if self.stations[a].distance_to(self.stations[b]) < self.max_pair
        ]

    def slant(self, station: str, anchor: str) -> float:
        tag = self.stations[station].transform(self.lever)
        x, y, z = self.anchors[anchor]
        return math.hypot(x - tag[0], y - tag[1], z - self.tag_heights.get(station, TAG_HEIGHT))

    def problem(self) -> GraphProblem:
        rng = np.random.default_rng(self.seed)
        matches = []
        for a, b in self.pairs():
            truth = self.stations[a].inverse() @ self.stations[b]
            error = Pose2(*(self.match_noise * MATCH_SIGMAS * rng.standard_normal(3)))
            score = 20.0 - truth.distance_to(Pose2.identity())
            covariance = np.diag(MATCH_SIGMAS**2)
            matches.append(ScanMatch(a, b, truth @ error, covariance, 0.6, 0.0, score, 0))
        links = []
        for s in self.stations:
            for a in self.anchors:
                distance = self.slant(s, a) + self.true_offset + self.long_ranges.get((s, a), 0.0)
                distance += self.range_noise * rng.standard_normal()
                if (s, a) not in self.deaf:
                    links.append(LinkMeasurement(s, a, distance, distance, 0.1, 100))
        points = {n: np.array(p) for n, p in self.anchors.items()}
        placed = [n for n in self.stations if n not in self.no_scan]
        first = self.stations[placed[0]].inverse() if placed else Pose2.identity()
        return GraphProblem(
            stations=tuple(
                Station(
                    name,
                    None if name in self.no_scan else NO_SCAN,
                    self.tag_heights.get(name, TAG_HEIGHT),
                    self.known_stations.get(name),
                )
                for name in self.stations
            ),
            anchors=tuple(
                Anchor(n, None if n in self.unmeasured else p[2], self.known_anchors.get(n))
                for n, p in self.anchors.items()
            ),
            matches=tuple(matches),
            placement={n: first @ self.stations[n] for n in placed},
            links=tuple(links),
            anchor_links=tuple(
                AnchorLink(a, b, float(np.linalg.norm(points[a] - points[b])), 0.1)
                for a, b in self.anchor_pairs
            ),
            tag_offset=self.lever,
            range_offset=self.range_offset,
            sequence=self.sequence,
            link_model=link_model(RangingSettings()),
        )

    def changed(self, **changes: object) -> Scene:
        return replace(self, **changes)

    def errors(self, estimate) -> dict[str, float]:
        """m (and rad) of everything placed, in the frame of the estimate."""
        first = Pose2.identity()
        if estimate.frame != "site":
            first = self.stations[estimate.frame].inverse()
        errors = {}
        for station in estimate.stations:
            if station.pose is not None:
                truth = first @ self.stations[station.id]
                errors[station.id] = station.pose.distance_to(truth)
                if station.heading_known:
                    errors[f"heading of {station.id}"] = station.pose.angle_to(truth)
        for anchor in estimate.anchors:
            if anchor.position is not None:
                truth = first.transform(self.anchors[anchor.id][:2])
                errors[anchor.id] = math.dist(anchor.position, truth)
        return errors


@pytest.fixture
def scene() -> Scene:
    return Scene()
