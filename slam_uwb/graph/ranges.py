"""Links -> the ranges that enter the graph, as arrays; and why the others do not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points, Pose2, Vector2
from ..model.link_law import LinkDensity, LinkModel
from ..model.products import GraphProblem, LinkMeasurement
from ..model.settings import GraphSettings
from ..model.survey import AnchorId, RangeOffset, StationId
from .range_fit import LEAST_CURVATURE
from .sightings import Sightings
from .variables import Places, Variables


@dataclass(frozen=True, slots=True, eq=False)
class Levers:
    """Where the tag sits on each station."""

    offset: Vector2
    """(2,) m in the scanner's frame."""
    headings: frozenset[StationId]
    """Stations whose heading is measured. For the others the tag's place itself is solved: its mean
    over all headings is the station's."""

    def of(self, station: StationId) -> Vector2:
        """(2,) m, zero where the heading is not known."""
        return self.offset if station in self.headings else np.zeros(2)

    def tags(self, poses: Mapping[StationId, Pose2]) -> dict[StationId, Vector2]:
        """(2,) m, the tag of each station."""
        return {name: pose.transform(self.of(name)) for name, pose in poses.items()}


def range_prior(problem: GraphProblem, settings: GraphSettings) -> RangeOffset:
    """What is known of the common offset: the survey's word, else the prior of such radios."""
    if problem.range_offset is not None:
        return problem.range_offset
    if settings.radios == "calibrated":
        return RangeOffset(0.0, settings.calibrated_sigma_m)
    return RangeOffset(settings.offset_mean_m, settings.offset_sigma_m)


def link_reasons(problem: GraphProblem) -> tuple[str | None, ...]:
    """Why each link cannot be used whatever is placed; None where it can."""
    tags = {station.id: math.isfinite(station.tag_height) for station in problem.stations}
    return tuple(
        link.rejection
        or (None if math.isfinite(link.distance) else "no distance")
        or (None if tags[link.station] else "the height of the tag is not known")
        for link in problem.links
    )


def usable_links(
    problem: GraphProblem, poses: Mapping[StationId, Pose2], settings: GraphSettings
) -> tuple[LinkMeasurement, ...]:
    """Links that can be used, with the sigmas that they deserve together.

    Stations of nearly one place see the same walls and reflections: the error of their links is one
    error, so n of them get sigma sqrt(n).
    """
    reasons = link_reasons(problem)
    links = [k for k, reason in zip(problem.links, reasons, strict=True) if reason is None]
    # Stations not placed yet have no neighbours.
    nowhere = Pose2(math.nan, math.nan, 0.0)
    where = [poses.get(link.station, nowhere) for link in links]
    places = np.array([[pose.x, pose.y] for pose in where]).reshape(-1, 2)
    rows: dict[AnchorId, list[int]] = {}
    for row, link in enumerate(links):
        rows.setdefault(link.anchor, []).append(row)
    crowd = np.ones(len(links), dtype=np.intp)
    for same in rows.values():
        apart = places[same, None, :] - places[same]
        near = np.hypot(apart[..., 0], apart[..., 1]) < settings.shared_error_radius_m
        crowd[same] = np.maximum(near.sum(axis=1), 1)
    return tuple(
        link if count == 1 else replace(link, sigma=link.sigma * math.sqrt(count))
        for link, count in zip(links, crowd.tolist(), strict=True)
    )


def anchor_sightings(
    problem: GraphProblem, links: tuple[LinkMeasurement, ...], anchor: AnchorId,
    tags: Mapping[StationId, Vector2], anchors: Mapping[AnchorId, Vector2],
    heights: Mapping[AnchorId, float],
) -> Sightings:  # fmt: skip
    """From where an anchor is seen: tags, then the placed anchors that measure it."""
    tag_heights = {station.id: station.tag_height for station in problem.stations}
    rows = [
        (*tags[link.station], tag_heights[link.station], link.distance, link.sigma)
        for link in links
        if link.anchor == anchor and link.station in tags
    ]
    for link in problem.anchor_links:
        ends = {link.anchor_a, link.anchor_b}
        if anchor in ends and len(ends) == 2:
            (other,) = ends - {anchor}
            if other in anchors and other in heights:
                rows.append((*anchors[other], heights[other], link.distance, link.sigma))
    return _sightings(rows)


def station_sightings(
    links: tuple[LinkMeasurement, ...], station: StationId,
    anchors: Mapping[AnchorId, Vector2], heights: Mapping[AnchorId, float],
) -> Sightings:  # fmt: skip
    """From which placed anchors a station is seen."""
    return _sightings(
        [
            (*anchors[link.anchor], heights[link.anchor], link.distance, link.sigma)
            for link in links
            if link.station == station and link.anchor in anchors and link.anchor in heights
        ]
    )


def _sightings(rows: list[tuple[float, ...]]) -> Sightings:
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Sightings(table[:, :2], table[:, 2], table[:, 3], table[:, 4])


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """R ranges as they are at one estimate."""

    slants: FloatArray
    """(R,) m, between the points; a nanometre at least."""
    directions: FloatArray
    """(R, 2) derivative of the predicted range by the second point."""
    residuals: FloatArray
    """(R,) m, measured minus predicted minus offset."""


@dataclass(frozen=True, slots=True, eq=False)
class RangeTable:
    """R ranges between points: the tags of the solved stations, then the solved anchors."""

    stations: tuple[StationId, ...]
    anchors: tuple[AnchorId, ...]
    lost: frozenset[StationId]
    """Stations that nothing but ranges holds."""
    levers: FloatArray
    """(S, 2) m, the tag in each station's frame."""
    first: NDArray[np.intp]
    """(R,) index of a point: a tag, or for a range between anchors an anchor."""
    second: NDArray[np.intp]
    """(R,) index of a point: an anchor."""
    measured: FloatArray
    """(R,) m."""
    sigmas: FloatArray
    """(R,) m."""
    rises: FloatArray
    """(R,) m, height of the second point above the first."""

    def residuals(self, variables: Variables) -> FloatArray:
        """(R,) m, measured minus predicted minus offset."""
        return self.spans(self.places(variables)).residuals

    def ends(self, variables: Variables) -> FloatArray:
        """(2, R, 2) m, where both points are."""
        return self._ends(self.places(variables))

    def places(self, variables: Variables) -> Places:
        """The variables in the order of the table's points."""
        poses = [variables.poses[name].vector for name in self.stations]
        anchors = [variables.anchors[name] for name in self.anchors]
        offsets = [variables.offset_of(name) for name in self.anchors]
        return Places(
            np.array(poses).reshape(-1, 3),
            np.array(anchors).reshape(-1, 2),
            np.array([*offsets, variables.offset]),
        )

    def spans(self, places: Places) -> Spans:
        """The ranges as they are with everything in these places."""
        first, second = self._ends(places)
        apart = second - first
        square = (apart**2).sum(axis=1) + self.rises**2
        slants = np.maximum(np.sqrt(square), 1e-9)
        between = self.first >= len(self.stations)
        offsets = places.offsets[np.where(between, -1, self.second - len(self.stations))]
        # Straight below the anchor the derivative does not exist; zero is its mean.
        return Spans(slants, apart / slants[:, None], self.measured - offsets - slants)

    def _ends(self, places: Places) -> FloatArray:
        """(2, R, 2) m, where both points are."""
        c, s = np.cos(places.poses[:, 2]), np.sin(places.poses[:, 2])
        x, y = self.levers.T
        tags = places.poses[:, :2] + np.column_stack([c * x - s * y, s * x + c * y])
        points: Points = np.vstack([tags, places.anchors])
        return np.stack([points[self.first], points[self.second]])


def build_range_table(
    problem: GraphProblem, links: tuple[LinkMeasurement, ...], variables: Variables,
    heights: Mapping[AnchorId, float], levers: Levers, lost: frozenset[StationId],
) -> RangeTable:  # fmt: skip
    """Ranges both of whose ends are among the variables."""
    stations, anchors = tuple(variables.poses), tuple(variables.anchors)
    index: dict[str, int] = {name: k for k, name in enumerate(stations)}
    # Stations and anchors may share a name: the anchors have an index of their own.
    anchor_index = {name: len(stations) + k for k, name in enumerate(anchors)}
    tag_heights = {station.id: station.tag_height for station in problem.stations}
    rows = [
        (index[k.station], anchor_index[k.anchor], k.distance, k.sigma,
         heights[k.anchor] - tag_heights[k.station])
        for k in links
        if k.station in index and k.anchor in anchor_index and k.anchor in heights
    ] + [
        (anchor_index[k.anchor_a], anchor_index[k.anchor_b], k.distance, k.sigma,
         heights[k.anchor_b] - heights[k.anchor_a])
        for k in problem.anchor_links
        if k.anchor_a != k.anchor_b
        and all(end in anchor_index and end in heights for end in (k.anchor_a, k.anchor_b))
    ]  # fmt: skip
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return RangeTable(
        stations=stations,
        anchors=anchors,
        lost=lost,
        levers=np.array([levers.of(name) for name in stations]).reshape(-1, 2),
        first=table[:, 0].astype(np.intp),
        second=table[:, 1].astype(np.intp),
        measured=table[:, 2],
        sigmas=table[:, 3],
        rises=table[:, 4],
    )


@dataclass(frozen=True, slots=True, eq=False)
class RangeCosts:
    """What R ranges cost at one estimate, to second order in their errors."""

    spans: Spans
    costs: FloatArray
    """(R,) negative log likelihood."""
    slopes: FloatArray
    """(R,) 1/m, by the error."""
    curvatures: FloatArray
    """(R,) 1/m^2, of any sign."""


@dataclass(frozen=True, slots=True, eq=False)
class WeighedRanges:
    """The ranges with the density of their errors."""

    table: RangeTable
    density: LinkDensity
    """(R,)"""
    curvature_limits: tuple[float, float]
    """1/m^2, of a link that counts in full: the least that is let in, and what no cost exceeds."""

    def expand(self, places: Places) -> RangeCosts:
        """The costs to second order at these places."""
        spans = self.table.spans(places)
        costs, slopes, curvatures = self.density.expand(spans.residuals)
        return RangeCosts(spans, costs, slopes, curvatures)

    def let_in(self, here: RangeCosts, safe: bool) -> FloatArray:
        """(R,) 1/m^2, curvatures that are positive: the costs' own or, if safe, what they nowhere exceed."""
        least, most = self.curvature_limits
        weights = self.density.weights
        return most * weights if safe else np.maximum(here.curvatures, least * weights)


def weigh_ranges(table: RangeTable, labels: FloatArray, model: LinkModel) -> WeighedRanges:
    """The table with the density that the model gives for links with these labels (R, W)."""
    peak = model.sight_sigma**-2
    density = model.density(labels, table.sigmas)
    return WeighedRanges(table, density, (LEAST_CURVATURE * peak, peak))
