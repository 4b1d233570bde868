"""How far the ranges let a point be from its estimate, tails included.

The inverse Hessian at the minimum knows nothing of tails. Under a loss that lets go of long ranges
they are heavy: in simulated corridors with walls, one anchor in twenty called `ok` lay further off
than the Hessian can explain, one in two hundred with the second moment taken here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.geometry import FloatArray, Matrix2, Vector2
from ..model.survey import RangeOffset
from .estimate import joint_order
from .find import Found, Scene
from .losses import one_sided_cost
from .ranges import anchor_sightings, station_sightings, usable_links
from .sightings import Finding, Sightings
from .variables import Variables

REACH = 12.0
"""Standard deviations looked at on each axis: far into the tails, short of mirror images."""
STEPS = 41
OFFSETS = 5
"""Nodes of Gauss-Hermite quadrature over the common offset."""


def add_tails(
    scene: Scene, solved: Variables, found: Found, covariance: FloatArray, offset: RangeOffset
) -> Found:
    """The findings, with what the tails of the ranges add to each place that only they hold.

    Args:
        scene: problem and frame.
        solved: the solution.
        found: what it was made of.
        covariance: joint, of the final linearisation, in the order of `joint_order`.
        offset: estimate and uncertainty of the offset common to all ranges.
    """
    links = usable_links(scene.problem, solved.poses, scene.settings)
    station_names, anchor_names = joint_order(scene.problem, solved)
    base = {name: solved.poses[name] for name in scene.start.poses}
    tags, heights = scene.levers.tags(base), found.heights()
    tag_heights = {station.id: station.tag_height for station in scene.problem.stations}

    def with_tails(finding: Finding, place: Vector2, row: int, seen: Sightings) -> Finding:
        block = covariance[row : row + 2, row : row + 2]
        height, scale = finding.height or 0.0, scene.settings.nlos_scale
        extra = tail_covariance(place, block, seen, height, offset, scale)
        return replace(finding, extra=extra if finding.extra is None else finding.extra + extra)

    anchors, stations = dict(found.anchors), dict(found.stations)
    known = {a.id for a in scene.problem.anchors if scene.known_place(a) is not None}
    for k, anchor in enumerate(anchor_names):
        if anchor not in known:
            others = {name: place for name, place in solved.anchors.items() if name != anchor}
            seen = anchor_sightings(scene.problem, links, anchor, tags, others, heights)
            row = 3 * len(station_names) + 2 * k
            anchors[anchor] = with_tails(anchors[anchor], solved.anchors[anchor], row, seen)
    for k, station in enumerate(station_names):
        if station in stations:
            seen = station_sightings(links, station, solved.anchors, heights)
            finding = replace(stations[station], height=tag_heights[station])
            place = solved.poses[station].translation
            stations[station] = with_tails(finding, place, 3 * k, seen)
    return Found(anchors, stations)


def tail_covariance(
    place: Vector2,
    covariance: Matrix2,
    seen: Sightings,
    height: float,
    offset: RangeOffset,
    scale: float,
) -> Matrix2:
    """What the tails add to the covariance of a place.

    Args:
        place: (2,) the estimate, m.
        covariance: (2, 2) of the final linearisation, m^2.
        seen: ranges to the point.
        height: of the point, m.
        offset: estimate and uncertainty of the offset common to all ranges.
        scale: of the one-sided loss.

    Returns:
        (2, 2) m^2, positive semi-definite: the part of the second moment of the likelihood about
        the estimate, over a grid along the principal axes, that exceeds `covariance`.
    """
    if len(seen.points) == 0:
        return np.zeros((2, 2))
    variances, axes = np.linalg.eigh(covariance)
    steps = np.linspace(-REACH, REACH, STEPS)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    delta = (grid * np.sqrt(variances)) @ axes.T
    weights = _likelihood(seen.residuals(place + delta, height, offset.mean), seen, offset, scale)
    moment = (delta * (weights / weights.sum())[:, None]).T @ delta
    excess, directions = np.linalg.eigh(moment - covariance)
    return np.asarray((directions * np.maximum(excess, 0.0)) @ directions.T)


def _likelihood(
    residuals: FloatArray, seen: Sightings, offset: RangeOffset, scale: float
) -> FloatArray:
    """(K,) likelihood, up to a factor, of K places with residuals (K, N), over all offsets."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(OFFSETS)
    shifted = [residuals - offset.sigma * node for node in nodes]
    costs = np.array([one_sided_cost(r, seen.sigmas, scale).sum(axis=1) for r in shifted])
    return np.asarray(weights @ np.exp(costs.min() - costs))
