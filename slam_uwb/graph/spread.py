"""How far the ranges let a point be from its estimate, tails and other sides of walls included.

The inverse Hessian at the minimum knows nothing of tails, and it holds the labels of the links as they
are at the estimate. A step through a wall changes the labels of many links at once: a place there may
explain the ranges as well or better. The second moment of the likelihood about the estimate, every
place judged by the walls on its own paths, knows both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Vector2
from ..model.link_law import LinkModel
from ..model.survey import RangeOffset
from .estimate import joint_order
from .find import Found, Scene
from .ranges import anchor_sightings, station_sightings, usable_links
from .sightings import Finding, Sightings
from .variables import Variables

REACH_SIGMAS = 5.0
"""Standard deviations looked at along each axis,"""
REACH = 0.7
"""m, and at least so far: through a wall, short of another place (`twin_distance_m`)."""
STEPS = 15
OFFSETS = 5
"""Nodes of Gauss-Hermite quadrature over the offset of the point's links."""


def add_tails(
    scene: Scene, model: LinkModel, solved: Variables, found: Found, covariance: FloatArray
) -> Found:
    """The findings, with what the likelihood adds to the covariance of each place that only ranges hold.

    Args:
        scene: problem and frame.
        model: of the links' errors.
        solved: the solution.
        found: what it was made of.
        covariance: joint, in the order of `joint_order`; then of the common offset and of those of
            the anchors.
    """
    links = usable_links(scene.problem, solved.poses, scene.settings)
    stations, anchors = joint_order(scene.problem, solved)
    tags = scene.levers.tags({name: solved.poses[name] for name in scene.start.poses})
    heights = found.heights()
    tag_heights = {station.id: station.tag_height for station in scene.problem.stations}
    known = {a.id for a in scene.problem.anchors if scene.known_place(a) is not None}
    offsets = 3 * len(stations) + 2 * len(anchors)
    sigmas = np.sqrt(np.diag(covariance)[offsets:])
    wide_anchors, wide_stations = dict(found.anchors), dict(found.stations)
    for k, anchor in enumerate(anchors):
        if anchor in known:
            continue
        others = {name: place for name, place in solved.anchors.items() if name != anchor}
        seen = anchor_sightings(scene.problem, links, anchor, tags, others, heights)
        row = 3 * len(stations) + 2 * k
        offset = RangeOffset(solved.offset_of(anchor), float(sigmas[1 + k]))
        extra = tail_covariance(
            solved.anchors[anchor], covariance[row : row + 2, row : row + 2], seen,
            heights[anchor], offset, model,
        )  # fmt: skip
        wide_anchors[anchor] = _wider(found.anchors[anchor], extra)
    for k, station in enumerate(stations):
        if station in found.stations:
            seen = station_sightings(links, station, solved.anchors, heights)
            own = float(np.hypot(sigmas[0], model.anchor_sigma))
            offset = RangeOffset(solved.offset, own)
            extra = tail_covariance(
                solved.poses[station].translation, covariance[3 * k : 3 * k + 2, 3 * k : 3 * k + 2],
                seen, tag_heights[station], offset, model,
            )  # fmt: skip
            wide_stations[station] = _wider(found.stations[station], extra)
    return Found(wide_anchors, wide_stations)


def _wider(finding: Finding, extra: Matrix2) -> Finding:
    return replace(finding, extra=extra if finding.extra is None else finding.extra + extra)


def tail_covariance(
    place: Vector2,
    covariance: Matrix2,
    seen: Sightings,
    height: float,
    offset: RangeOffset,
    model: LinkModel,
) -> Matrix2:
    """What the likelihood adds to the covariance of a place.

    Args:
        place: (2,) the estimate, m.
        covariance: (2, 2) of the final linearisation, m^2.
        seen: ranges to the point.
        height: of the point, m.
        offset: estimate and uncertainty of the offset of its links.
        model: of the links' errors.

    Returns:
        (2, 2) m^2, positive semi-definite: the part of the second moment of the likelihood about
        the estimate, over a grid along the principal axes, that exceeds `covariance`.
    """
    if len(seen.points) == 0:
        return np.zeros((2, 2))
    variances, axes = np.linalg.eigh(covariance)
    reach = np.maximum(REACH_SIGMAS * np.sqrt(variances), REACH)
    steps = np.linspace(-1.0, 1.0, STEPS)
    # Denser in the middle, where the likelihood usually is narrow.
    steps = np.sign(steps) * np.abs(steps) ** 1.5
    area = np.outer(np.gradient(steps), np.gradient(steps)).ravel()
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    delta = (grid * reach) @ axes.T
    weights = area * _likelihood(place + delta, seen, height, offset, model)
    moment = (delta * (weights / weights.sum())[:, None]).T @ delta
    excess, directions = np.linalg.eigh(moment - covariance)
    return np.asarray((directions * np.maximum(excess, 0.0)) @ directions.T)


def _likelihood(
    places: FloatArray, seen: Sightings, height: float, offset: RangeOffset, model: LinkModel
) -> FloatArray:
    """(K,) likelihood, up to a factor, of K places, over all offsets."""
    labels = model.labels(seen.points, places[:, None, :])
    density = model.density(labels, np.broadcast_to(seen.sigmas, labels.shape[:2]))
    nodes, weights = np.polynomial.hermite_e.hermegauss(OFFSETS)
    residuals = seen.residuals(places, height, offset.mean)
    costs = np.array([density.costs(residuals - offset.sigma * n).sum(axis=1) for n in nodes])
    return np.asarray(weights @ np.exp(costs.min() - costs))
