"""What the solution says of each link: walls crossed, and whether the range is simply wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..model.geometry import FloatArray, Points
from ..model.link_law import LinkDensity, LinkModel
from ..model.products import LinkMeasurement
from ..model.survey import AnchorId, StationId
from .find import Scene
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
    heights: dict[AnchorId, float],
    links: tuple[LinkMeasurement, ...],
) -> dict[LinkName, LinkVerdict]:
    """Verdicts of all links both of whose ends are placed.

    Args:
        scene: problem and frame.
        model: of the links' errors.
        solved: the solution.
        sides: of the anchors: where the walls on their links' paths are counted.
        heights: m, of the anchors.
        links: usable ones.
    """
    tags = scene.levers.tags(solved.poses)
    ends = [
        k for k in links if k.station in tags and k.anchor in solved.anchors and k.anchor in heights
    ]
    if not ends:
        return {}
    tag_heights = {station.id: station.tag_height for station in scene.problem.stations}
    first = np.array([tags[k.station] for k in ends])
    second = np.array([solved.anchors[k.anchor] for k in ends])
    labelled = label_places([k.anchor for k in ends], solved, sides)
    rises = np.array([heights[k.anchor] - tag_heights[k.station] for k in ends])
    slant = np.sqrt(((second - first) ** 2).sum(axis=1) + rises**2)
    errors = np.array([k.distance - solved.offset_of(k.anchor) for k in ends]) - slant
    density = model.density(model.labels(first, labelled), np.array([k.sigma for k in ends]))
    walls, faults = density.posterior(errors)
    verdicts = [
        _verdict(belief, float(fault), float(error), model)
        for belief, fault, error in zip(walls, faults, errors, strict=True)
    ]
    named = _name_swaps(ends, verdicts, errors, density)
    if all(verdict.fault is None or "swapped" not in verdict.fault for verdict in named):
        labels, sigmas = model.labels(first, second), np.array([k.sigma for k in ends])
        anchors = _links_by_anchor(ends, solved, first, rises)
        gains = swap_gains(anchors, lambda rows: model.density(labels[rows], sigmas[rows]))
        named = _name_open_swaps(ends, named, gains)
    return {(link.station, link.anchor): verdict for link, verdict in zip(ends, named, strict=True)}


def _links_by_anchor(
    links: list[LinkMeasurement], solved: Variables, tags: Points, rises: FloatArray
) -> list[AnchorLinks]:
    """The links of each anchor, with (L, 2) m of their tags and (L,) m that the anchors are above them."""
    found = []
    for anchor in dict.fromkeys(link.anchor for link in links):
        rows = np.array([k for k, link in enumerate(links) if link.anchor == anchor])
        offset = solved.offset_of(anchor)
        distances = np.array([links[k].distance for k in rows]) - offset
        found.append(
            AnchorLinks(rows, solved.anchors[anchor], tags[rows], rises[rows], distances, offset)
        )
    return found


def _name_open_swaps(
    links: list[LinkMeasurement],
    verdicts: list[LinkVerdict],
    gains: Mapping[tuple[int, int], float],
) -> list[LinkVerdict]:
    """The verdicts, with the pairs named that fit better swapped, whatever the solution's places say."""
    named, taken = list(verdicts), set[int]()
    for pair in sorted(gains, key=lambda pair: -gains[pair]):
        faulty = any(verdicts[link].fault is not None for link in pair)
        least = FAULTY_PAIR_GAIN if faulty else SOUND_PAIR_GAIN
        if gains[pair] > least and taken.isdisjoint(pair):
            taken.update(pair)
            for one, other in (pair, pair[::-1]):
                named[one] = replace(verdicts[one], fault=_swapped_with(links[other]))
    return named


def _swapped_with(other: LinkMeasurement) -> str:
    return f"fits anchor {other.anchor}: identifiers swapped at this station"


def _name_swaps(
    links: list[LinkMeasurement],
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
