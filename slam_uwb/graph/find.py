"""What the ranges determine at the present poses: anchors from tags, lost tags from anchors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..model.geometry import Vector2
from ..model.link_law import LinkModel
from ..model.products import GraphProblem, LinkMeasurement, Share, alone
from ..model.settings import GraphSettings
from ..model.solution import Status
from ..model.survey import Anchor, AnchorId, RangeOffset, StationId
from .frame import Start
from .initial import Search, find_height, find_point
from .range_fit import OffsetPrior
from .ranges import Levers, anchor_sightings, range_prior, station_sightings
from .sightings import Finding, Sightings
from .variables import Variables


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What stays the same while a problem is solved in one frame."""

    problem: GraphProblem
    settings: GraphSettings
    start: Start
    prior: RangeOffset
    levers: Levers
    share: Share

    @classmethod
    def of(
        cls, problem: GraphProblem, start: Start, settings: GraphSettings, share: Share = alone
    ) -> Scene:
        """The scene of a problem that starts there."""
        levers = Levers(np.array(problem.tag_offset), start.headings)
        return cls(problem, settings, start, range_prior(problem, settings), levers, share)

    def known_place(self, anchor: Anchor) -> Vector2 | None:
        """(2,) m, where the anchor was surveyed and the frame is the site's."""
        if anchor.known is None or not self.start.in_site:
            return None
        return np.array([anchor.known.x, anchor.known.y])


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What the ranges say of every anchor, and of every station that only they can place."""

    anchors: dict[AnchorId, Finding]
    stations: dict[StationId, Finding]

    def heights(self) -> dict[AnchorId, float]:
        """m, of the anchors that have one."""
        return {n: f.height for n, f in self.anchors.items() if f.height is not None}

    def agrees_with(self, solved: Variables, distance: float) -> bool:
        """Whether a solution has the same points, each within `distance` (m) of where found."""
        # Stations and anchors may share a name.
        found: dict[tuple[str, str], Vector2] = {}
        found |= {("a", n): f.place for n, f in self.anchors.items() if f.place is not None}
        found |= {("s", n): f.place for n, f in self.stations.items() if f.place is not None}
        have: dict[tuple[str, str], Vector2] = {("a", n): p for n, p in solved.anchors.items()}
        located = solved.poses.keys() & self.stations.keys()
        have |= {("s", n): solved.poses[n].translation for n in located}
        return found.keys() == have.keys() and all(
            np.hypot(*(place - have[name])) <= distance for name, place in found.items()
        )

    def settled(self, solved: Variables, distance: float) -> dict[AnchorId, Finding]:
        """The anchors' findings, with those that the solution has elsewhere not called `ok`."""
        return {
            name: replace(finding, status=Status.WEAK_GEOMETRY)
            if finding.status is Status.OK
            and finding.place is not None
            and name in solved.anchors
            and np.hypot(*(finding.place - solved.anchors[name])) > distance
            else finding
            for name, finding in self.anchors.items()
        }


def find_points(
    scene: Scene,
    model: LinkModel,
    present: Variables,
    links: tuple[LinkMeasurement, ...],
    before: Found,
) -> Found:
    """Look for every anchor from the placed stations, for every lost tag from the sure anchors.

    Args:
        scene: problem and frame.
        model: of the errors of the links.
        present: poses and anchors of the last solution.
        links: usable ones.
        before: what was found in the round before.
    """
    # The offset is taken from the solution, but as loosely as before it: the solution has seen the
    # very ranges that are judged here.
    offset = RangeOffset(present.offset, scene.prior.sigma)
    search = Search(model.as_it_is(), OffsetPrior(offset, model.anchor_sigma), scene.settings)
    heights = before.heights()
    sure = {
        name: place
        for name, place in present.anchors.items()
        if name in heights and before.anchors[name].status is Status.OK
    }
    tags = scene.levers.tags({name: present.poses[name] for name in scene.start.poses})
    views = [
        anchor_sightings(scene.problem, links, anchor.id, tags, sure, heights)
        for anchor in scene.problem.anchors
    ]
    wanted = [
        (scene.known_place(anchor), anchor.height, seen, before.anchors.get(anchor.id))
        for anchor, seen in zip(scene.problem.anchors, views, strict=True)
    ]
    found = scene.share(partial(_find_anchor, search), wanted)
    anchors = {a.id: finding for a, finding in zip(scene.problem.anchors, found, strict=True)}
    stations = {}
    for station in scene.problem.stations:
        if station.scan is None and station.id not in scene.start.poses:
            seen = station_sightings(links, station.id, sure, heights)
            same = _same_view(before.stations.get(station.id), seen)
            stations[station.id] = find_point(seen, station.tag_height, search, same)
    return Found(anchors, stations)


def _find_anchor(
    search: Search, wanted: tuple[Vector2 | None, float | None, Sightings, Finding | None]
) -> Finding:
    """Of an anchor's known place and height, what sees it, and what was found in the round before."""
    known, height, seen, before = wanted
    count = len(seen.points)
    if known is None:
        return find_point(seen, height, search, _same_view(before, seen))
    if height is not None or count < search.settings.min_stations:
        return Finding(Status.OK, known, height, count)
    height = find_height(seen, search)
    return Finding(Status.WEAK_GEOMETRY, known, height, count)


def _same_view(before: Finding | None, seen: Sightings) -> Finding | None:
    """The finding of the round before, where as many points see it now: no new search then."""
    return before if before is not None and before.sightings == len(seen.points) else None
