"""What the solution says of each link: walls crossed, and whether the range is simply wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import FloatArray, Points, Vector2
from ..model.link_law import LinkDensity, LinkModel
from ..model.products import LinkMeasurement
from ..model.survey import AnchorId, StationId
from .find import Found, Scene
from .sides import Sides, label_places
from .swaps import AnchorLinks, swap_gains
from .variables import Variables

LinkName = tuple[StationId, AnchorId]

FAULT_BELIEF = 0.5
"""A range is called a fault where that is likelier than not,"""
FAULT_SIGMAS = 5.0
"""and it is off by more than this many sigmas of a link in line of sight."""
SWAP_GAIN = 6.0
"""nats by which two ranges must fit better swapped where one of them is a fault,"""
FAULTY_PAIR_GAIN = 3.0
"""the same with the places left open (`swaps`): twenty to one,"""
SOUND_PAIR_GAIN = 4.0
"""and where neither is a fault: no pair of 160 surveys without a swap came above 3.0."""


@dataclass(frozen=True, slots=True)
class LinkVerdict:
    """What is thought of one link that was used."""

    walls: float
    """Expected number."""
    nlos_probability: float
    fault: str | None
    """What is wrong with the range; None where nothing is."""


def judge_links(
    scene: Scene,
    model: LinkModel,
    solved: Variables,
    sides: Sides,
    found: Found,
    links: tuple[LinkMeasurement, ...],
) -> dict[LinkName, LinkVerdict]:
    """Verdicts of all links both of whose ends are placed.

    Args:
        scene: problem and frame.
        model: of the links' errors.
        solved: the solution.
        sides: of the anchors: where the walls on their links' paths are counted.
        found: what the ranges say of the anchors, those without a place among them.
        links: usable ones.
    """
    paths = _paths(scene, solved, found, links)
    if not paths.links:
        return {}
    labelled = label_places([link.anchor for link in paths.links], solved, sides)
    offsets = np.array([solved.offset_of(link.anchor) for link in paths.links])
    errors = paths.distances - offsets - paths.slants
    density = model.density(model.labels(paths.tags, labelled), paths.sigmas)
    walls, faults = density.posterior(errors)
    verdicts = [
        _verdict(belief, float(fault), float(error), model)
        for belief, fault, error in zip(walls, faults, errors, strict=True)
    ]
    named = _name_swaps(paths.links, verdicts, errors, density)
    judged = {link.name: verdict for link, verdict in zip(paths.links, named, strict=True)}
    if any(verdict.fault and "swapped" in verdict.fault for verdict in named):
        return judged
    likely = replace(solved, anchors=_likely_places(found) | solved.anchors)
    return _name_open_swaps(_paths(scene, likely, found, links), judged, likely, model)


@dataclass(frozen=True, slots=True, eq=False)
class _Paths:
    """Links between places."""

    links: tuple[LinkMeasurement, ...]
    tags: Points
    """(L, 2) m."""
    places: Points
    """(L, 2) m, of the anchors."""
    rises: FloatArray
    """(L,) m, of the anchors above the tags."""

    @property
    def slants(self) -> FloatArray:
        """(L,) m."""
        return np.asarray(np.sqrt(((self.places - self.tags) ** 2).sum(axis=1) + self.rises**2))

    @property
    def distances(self) -> FloatArray:
        """(L,) m, as measured."""
        return np.array([link.distance for link in self.links])

    @property
    def sigmas(self) -> FloatArray:
        """(L,) m."""
        return np.array([link.sigma for link in self.links])


def _paths(
    scene: Scene, placed: Variables, found: Found, links: tuple[LinkMeasurement, ...]
) -> _Paths:
    """Those of the links both of whose ends have a place."""
    tags, heights = scene.levers.tags(placed.poses), found.heights()
    tag_heights = {station.id: station.tag_height for station in scene.problem.stations}
    ends = tuple(
        k for k in links if k.station in tags and k.anchor in placed.anchors and k.anchor in heights
    )
    return _Paths(
        ends,
        np.array([tags[k.station] for k in ends]).reshape(-1, 2),
        np.array([placed.anchors[k.anchor] for k in ends]).reshape(-1, 2),
        np.array([heights[k.anchor] - tag_heights[k.station] for k in ends]),
    )


def _likely_places(found: Found) -> dict[AnchorId, Vector2]:
    """The likeliest place of each anchor that has several."""
    several = {name: f.alternatives for name, f in found.anchors.items() if f.alternatives}
    likeliest = {name: max(places, key=lambda p: p.weight) for name, places in several.items()}
    return {name: np.array([place.x, place.y]) for name, place in likeliest.items()}


def _links_by_anchor(paths: _Paths, solved: Variables) -> list[AnchorLinks]:
    """The links of each anchor."""
    found = []
    for anchor in dict.fromkeys(link.anchor for link in paths.links):
        rows = np.array([k for k, link in enumerate(paths.links) if link.anchor == anchor])
        offset = solved.offset_of(anchor)
        found.append(
            AnchorLinks(
                rows, solved.anchors[anchor], paths.tags[rows], paths.rises[rows],
                paths.distances[rows] - offset, offset,
            )
        )  # fmt: skip
    return found


def _name_open_swaps(
    paths: _Paths,
    verdicts: Mapping[LinkName, LinkVerdict],
    solved: Variables,
    model: LinkModel,
) -> dict[LinkName, LinkVerdict]:
    """The verdicts, with the pairs named that fit better swapped, whatever the solution's places say.

    Of an anchor with several places its links have no verdict, but those that were swapped with them do.
    """
    labels, sigmas = model.labels(paths.tags, paths.places), paths.sigmas
    anchors = _links_by_anchor(paths, solved)
    gains = swap_gains(anchors, lambda rows: model.density(labels[rows], sigmas[rows]))
    named, taken = dict(verdicts), set[int]()
    for pair in sorted(gains, key=lambda pair: -gains[pair]):
        ends = [paths.links[number] for number in pair]
        faulty = any(end.name in verdicts and verdicts[end.name].fault is not None for end in ends)
        least = FAULTY_PAIR_GAIN if faulty else SOUND_PAIR_GAIN
        if gains[pair] > least and taken.isdisjoint(pair):
            taken.update(pair)
            for one, other in (ends, ends[::-1]):
                if one.name in named:
                    named[one.name] = replace(named[one.name], fault=_swapped_with(other))
    return named


def _swapped_with(other: LinkMeasurement) -> str:
    return f"fits anchor {other.anchor}: identifiers swapped at this station"


def _name_swaps(
    links: Sequence[LinkMeasurement],
    verdicts: list[LinkVerdict],
    errors: FloatArray,
    density: LinkDensity,
) -> list[LinkVerdict]:
    """The verdicts, with ranges of one station named that would fit if their anchors were swapped."""
    named = list(verdicts)
    distances = np.array([link.distance for link in links])
    costs, predicted = density.costs(errors), distances - errors
    for k in [k for k, verdict in enumerate(verdicts) if verdict.fault is not None]:
        others = [i for i, link in enumerate(links) if link.station == links[k].station and i != k]
        if not others:
            continue
        here = density.costs(distances[k] - predicted)[others]
        # The other range, were it the one of this anchor.
        there = np.array([density.costs(distances[i] - predicted)[k] for i in others])
        gains = costs[k] + costs[others] - here - there
        best = int(np.argmax(gains))
        if gains[best] > SWAP_GAIN:
            for one, other in ((k, others[best]), (others[best], k)):
                named[one] = replace(verdicts[one], fault=_swapped_with(links[other]))
    return named


def _verdict(belief: FloatArray, fault: float, error: float, model: LinkModel) -> LinkVerdict:
    sound = max(float(belief.sum()), 1e-12)
    reason = None
    if fault > FAULT_BELIEF and abs(error) > FAULT_SIGMAS * model.sight_sigma:
        side = "long" if error > 0.0 else "short"
        reason = f"{abs(error):.2f} m too {side} for the place that the other ranges give"
    return LinkVerdict(
        walls=float(np.arange(len(belief)) @ belief / sound),
        nlos_probability=float(1.0 - belief[0] / sound),
        fault=reason,
    )
