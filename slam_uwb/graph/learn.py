"""What a survey's own ranges tell of its links: parameters of the link model by Laplace evidence.

At the present places of the tags, anchors and offsets are integrated out (second order about their
best places under each set of parameters), and the set that the ranges support best is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..model.geometry import Points
from ..model.link_law import LinkModel
from ..model.products import LinkMeasurement
from ..model.survey import RangeOffset
from .find import Found, Scene
from .range_fit import (
    LEAST_CURVATURE,
    OffsetPrior,
    RangeFit,
    RangeView,
    fit_ranges,
    log_evidence_cost,
)
from .ranges import anchor_sightings, usable_links
from .sides import Sides, label_places
from .sightings import Sightings
from .variables import Variables

NO_OFFSET_SIGMA = 1e-3
"""m. Of an offset that is not there."""


def learn_links(
    scene: Scene,
    model: LinkModel,
    present: Variables,
    found: Found,
    links: tuple[LinkMeasurement, ...],
    sides: Sides,
) -> LinkModel:
    """The model with the parameters that the ranges of the placed anchors support best.

    Args:
        scene: problem and frame.
        model: where to start.
        present: poses and anchors of the last solution.
        found: what it was made of.
        links: usable ones.
        sides: of the anchors: where their labels are taken.
    """
    view, places, seen = _placed_anchors(scene, present, found, links, sides)
    if view is None:
        return model
    return model.fitted(_evidence(scene.prior, view, places, seen, model))[0]


def needs_no_offsets(
    scene: Scene,
    model: LinkModel,
    present: Variables,
    found: Found,
    sides: Sides,
) -> tuple[LinkModel, RangeOffset] | None:
    """The model and offset of calibrated radios in line of sight, if the ranges ask for nothing else.

    Offsets that nobody needs cost accuracy: they are dropped where the evidence of line of sight
    without them is better by `no_offset_gain` than both rivals: line of sight with offsets (like with
    like, or it would be the tails that are compared) and the full model (one link behind a wall
    speaks against dropping). Arguments as `learn_links`.
    """
    # Every link by itself: where stations crowd, links that count as one could not tell an offset.
    links = usable_links(scene.problem, {}, scene.settings)
    view, places, seen = _placed_anchors(scene, present, found, links, sides)
    if view is None:
        return None
    known, settings = scene.problem.range_offset, scene.settings
    none = RangeOffset(0.0 if known is None else known.mean, NO_OFFSET_SIGMA)
    # Who says that the radios are calibrated, or by how much they are off, is believed unless the
    # ranges say otherwise.
    told = known is not None or settings.radios == "calibrated"
    margin = -settings.no_offset_gain if told else settings.no_offset_gain
    clear, offset_clear = model.cleared(NO_OFFSET_SIGMA), model.cleared(model.anchor_sigma)
    clear, without = clear.fitted(_evidence(none, view, places, seen, clear))
    # The cheap rival first: where links are behind walls it settles the question.
    for rival in (offset_clear, model):
        if rival.fitted(_evidence(scene.prior, view, places, seen, rival))[1] - without <= margin:
            return None
    return clear, none


def _placed_anchors(
    scene: Scene,
    present: Variables,
    found: Found,
    links: tuple[LinkMeasurement, ...],
    sides: Sides,
) -> tuple[RangeView | None, Points, Points]:
    """The placed anchors as seen from all placed stations, (A, 2) m where they are and are labelled."""
    tags, heights = scene.levers.tags(present.poses), found.heights()
    names = [name for name in present.anchors if name in heights]
    if not names:
        return None, np.zeros((0, 2)), np.zeros((0, 2))
    seen = [anchor_sightings(scene.problem, links, name, tags, {}, heights) for name in names]
    view = stack(seen, [heights[name] for name in names])
    places = np.array([present.anchors[name] for name in names])
    return view, places, label_places(names, present, sides)


def _evidence(
    common: RangeOffset, view: RangeView, places: Points, seen: Points, model: LinkModel
) -> Callable[[LinkModel], float]:
    """Negative log evidence of the ranges under a model near `places`, with labels as of `seen` (A, 2)."""
    labels = model.labels(view.points, seen[:, None, :])
    last: RangeFit | None = None

    def cost(candidate: LinkModel) -> float:
        nonlocal last
        prior = OffsetPrior(common, candidate.anchor_sigma)
        density = candidate.density(labels, view.sigmas)
        floor = LEAST_CURVATURE / candidate.sight_sigma**2
        start = places if last is None else last.places
        last = fit_ranges(view, density, prior, start, floor, coupled=True, start=last, still=1e-9)
        return log_evidence_cost(last, prior)

    return cost


def stack(seen: Sequence[Sightings], heights: Sequence[float]) -> RangeView:
    """The sightings of several points as one view, padded with ranges that count nothing."""
    width = max(len(sightings.points) for sightings in seen)
    points = np.zeros((len(seen), width, 2))
    rises, distances = np.zeros((2, len(seen), width))
    sigmas = np.full((len(seen), width), np.inf)
    for k, (sightings, height) in enumerate(zip(seen, heights, strict=True)):
        count = len(sightings.points)
        points[k, :count] = sightings.points
        rises[k, :count] = height - sightings.heights
        distances[k, :count] = sightings.distances
        sigmas[k, :count] = sightings.sigmas
    return RangeView(points, rises, distances, sigmas)
