"""On which side of the walls about it an anchor is, and what holds it there.

Labels of where a point was solved lead it on, step by step, through the wall that it hangs on, though no
place behind explains the ranges as well: there every path would cross one wall more. So labels are those
of the likeliest place nearby, each place judged by the walls on its own paths; and what the cost gains
from labels that change with the place enters the graph as a Gaussian that touches it there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import gtsam
import numpy as np

from ..model.geometry import FloatArray, Matrix2, Points, Vector2
from ..model.link_law import LinkModel
from ..model.products import LinkMeasurement
from ..model.survey import AnchorId, StationId
from . import factors
from .find import Found, Scene
from .initial import own_axes
from .ranges import anchor_sightings
from .sightings import Sightings
from .variables import Indices, Variables

REACH_M, STEP_M = 1.05, 0.15
"""m to each side looked at: through a wall and behind it."""
OFFSETS = 5
"""Nodes of Gauss-Hermite quadrature over the offset of the anchor's links."""
SPACING_M = 0.02
"""Of the places that tell slopes and curvatures: a third of what labels take to change."""
MAX_STEPS, LONGEST_M, NEAR_M, STILL_M = 30, 0.1, 1e-3, 1e-9
LONGEST_PULL_M = 0.2
"""A slope pulls no further, whatever its curvature."""

TOO_NEAR_M = 1.0
"""A station nearer than this has no bearing to speak of."""

Costs = Callable[[Points], FloatArray]
"""Places (K, 2), m -> (K,) nats."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """Where the labels of an anchor are taken, and how its cost changes with them."""

    place: Vector2
    """(2,) m."""
    pull: Vector2
    """(2,) m, from there to where the change of labels alone would lead."""
    curvature: Matrix2
    """(2, 2) 1/m^2, positive definite."""


Sides = Mapping[AnchorId, Side]
NO_SIDES: Sides = MappingProxyType({})


def likely_sides(
    scene: Scene, model: LinkModel, present: Variables, found: Found,
    links: tuple[LinkMeasurement, ...],
) -> Sides:  # fmt: skip
    """The side of every placed anchor whose place is not known.

    Args:
        scene: problem and frame.
        model: of the links' errors.
        present: poses and anchors of the last solution.
        found: what it was made of.
        links: usable ones.
    """
    tags, heights = scene.levers.tags(present.poses), found.heights()
    known = {a.id for a in scene.problem.anchors if scene.known_place(a) is not None}
    sigma = math.hypot(scene.prior.sigma, model.anchor_sigma)
    wanted: dict[AnchorId, tuple[Vector2, PlaceCosts]] = {}
    for anchor, place in present.anchors.items():
        if anchor in known or anchor not in heights:
            continue
        seen = anchor_sightings(scene.problem, links, anchor, tags, {}, heights)
        if len(seen.points):
            costs = PlaceCosts(seen, heights[anchor], model.as_it_is(), present.offset, sigma)
            wanted[anchor] = place, costs
    return dict(zip(wanted, scene.share(_likely_side, list(wanted.values())), strict=True))


def _likely_side(about: tuple[Vector2, PlaceCosts]) -> Side:
    place, costs = about
    return side_at(refined_place(likeliest_place(place, costs), costs), costs)


def label_places(names: Sequence[AnchorId], present: Variables, sides: Sides) -> Points:
    """(N, 2) m, where the labels of these anchors are taken: where they are, if they have no side."""
    places = [sides[name].place if name in sides else present.anchors[name] for name in names]
    return np.array(places).reshape(-1, 2)


def side_factors(
    sides: Sides, present: Variables, stations: Collection[StationId], indices: Indices
) -> list[gtsam.NonlinearFactor]:
    """What holds the anchors on their sides, as seen from the nearest of `stations`: walls move with it."""
    held: list[gtsam.NonlinearFactor] = []
    for name, side in sides.items():
        apart = {
            s: math.dist(present.poses[s].translation, side.place)
            for s in sorted(stations)
            if s in present.poses
        }
        if name not in present.anchors or not apart:
            continue
        station = min(apart, key=lambda s: (apart[s] < TOO_NEAR_M, apart[s]))
        pose = present.poses[station]
        x, y = pose.inverse().transform(side.place + side.pull)
        away = max(math.hypot(x, y), 1e-3)
        # By a change of bearing and of range the place moves along the columns.
        moved = pose.rotation @ np.array([[-y, x / away], [x, y / away]])
        information = moved.T @ side.curvature @ moved
        noise = gtsam.noiseModel.Gaussian.Information((information + information.T) / 2.0)
        ends = factors.X(indices.stations[station]), factors.L(indices.anchors[name])
        bearing = gtsam.Rot2(math.atan2(y, x))
        held.append(gtsam.BearingRangeFactor2D(*ends, bearing, away, noise))
    return held


@dataclass(frozen=True, slots=True, eq=False)
class PlaceCosts:
    """Of the ranges to one anchor, wherever it may be, over all offsets of its links."""

    seen: Sightings
    height: float
    model: LinkModel
    offset: float
    sigma: float

    @property
    def axes(self) -> FloatArray:
        """(2, 2) that turn with the points: what is found does not depend on the frame."""
        return own_axes(self.seen.points)[0]

    def __call__(self, places: Points, labelled_at: Vector2 | None = None) -> FloatArray:
        """(K,) nats, with the walls on each place's own paths or on those to one place."""
        at = places[:, None, :] if labelled_at is None else labelled_at[None, None, :]
        labels = self.model.labels(self.seen.points, at)
        labels = np.broadcast_to(labels, (len(places), *labels.shape[1:]))
        sigmas = np.broadcast_to(self.seen.sigmas, labels.shape[:2])
        density = self.model.density(labels, sigmas)
        residuals = self.seen.residuals(places, self.height, self.offset)
        nodes, weights = np.polynomial.hermite_e.hermegauss(OFFSETS)
        costs = np.array([density.costs(residuals - self.sigma * n).sum(axis=1) for n in nodes])
        least = costs.min(axis=0)
        return np.asarray(least - np.log(weights @ np.exp(least - costs)))


def likeliest_place(place: Vector2, costs: PlaceCosts) -> Vector2:
    """(2,) m, of places on a grid about one."""
    line = np.arange(-REACH_M, REACH_M + 1e-9, STEP_M)
    cells = place + np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2) @ costs.axes.T
    return np.asarray(cells[np.argmin(costs(cells))])


def refined_place(place: Vector2, costs: PlaceCosts) -> Vector2:
    """(2,) m, the minimum next to a place."""
    for _ in range(MAX_STEPS):
        here, slope, curvature = _expanded(place, costs, costs.axes)
        values, axes = np.linalg.eigh(curvature)
        step = -axes @ ((axes.T @ slope) / np.maximum(np.abs(values), 1.0))
        length = float(np.hypot(*step))
        if length < NEAR_M:
            # The slope's own root: differences see the minimum a little beside it.
            place = place + step
            if length < STILL_M:
                break
            continue
        step *= min(1.0, LONGEST_M / length)
        trials = place + np.outer([1.0, 0.3, 0.1, 0.03], step)
        lower = np.flatnonzero(costs(trials) < here)
        if not len(lower):
            break
        place = trials[lower[0]]
    return place


def side_at(place: Vector2, costs: PlaceCosts) -> Side:
    """The side at a place: of all costs less those with the labels of the place."""
    _, slope, curvature = _expanded(
        place, lambda p: costs(p) - costs(p, labelled_at=place), costs.axes
    )
    values, axes = np.linalg.eigh(curvature)
    along = axes.T @ slope
    values = np.maximum(values, np.abs(along) / LONGEST_PULL_M + 1e-6)
    return Side(place, -axes @ (along / values), (axes * values) @ axes.T)


def _expanded(place: Vector2, costs: Costs, axes: FloatArray) -> tuple[float, Vector2, Matrix2]:
    """Cost, slope (2,) and curvature (2, 2) at a place, by differences along axes (2, 2, as columns)."""
    line = SPACING_M * np.array([-1.0, 0.0, 1.0])
    cells = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    v = costs(place + cells @ axes.T).reshape(3, 3)
    slope = np.array([v[2, 1] - v[0, 1], v[1, 2] - v[1, 0]]) / (2.0 * SPACING_M)
    mixed = (v[2, 2] - v[2, 0] - v[0, 2] + v[0, 0]) / 4.0
    xx, yy = v[2, 1] - 2.0 * v[1, 1] + v[0, 1], v[1, 2] - 2.0 * v[1, 1] + v[1, 0]
    curvature = np.array([[xx, mixed], [mixed, yy]]) / SPACING_M**2
    return float(v[1, 1]), axes @ slope, axes @ curvature @ axes.T
