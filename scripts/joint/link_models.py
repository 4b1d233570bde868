"""Rivals of the link model of `ranging`, handed to the solver in its place.

They follow the protocol `slam_uwb.model.link_law.LinkModel`: one loss for all links, the density with
the parameters that it starts from, and the density where the number of walls on every link is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from slam_uwb import Pose2, Reference
from slam_uwb.evaluate import rigid_alignment
from slam_uwb.model.geometry import FloatArray
from slam_uwb.model.survey import AnchorId, StationId
from slam_uwb.ranging import LinkModel

Expansion = tuple[FloatArray, FloatArray, FloatArray]
"""Cost, slope and curvature."""
CAUCHY = 2.385
"""Sigmas; 95 % efficient where errors are Gaussian after all (Rey 1983)."""


def gaussian(errors: FloatArray) -> Expansion:
    """Least squares, of errors in sigmas."""
    return 0.5 * errors**2, errors, np.ones_like(errors)


def one_sided(errors: FloatArray) -> Expansion:
    """Least squares where a range is too short, Cauchy's loss where it is too long: walls make it longer."""
    far = np.maximum(errors, 0.0) / CAUCHY
    bent = 1.0 + far**2
    long = errors > 0.0
    cost = np.where(long, 0.5 * CAUCHY**2 * np.log(bent), 0.5 * errors**2)
    return cost, errors / bent, (1.0 - far**2) / bent**2


@dataclass(frozen=True, slots=True, eq=False)
class LossDensity:
    """One loss for each of L links."""

    loss: Callable[[FloatArray], Expansion]
    sigma: float
    """m."""
    weights: FloatArray
    """(..., L) how much each link counts, 0-1."""

    def costs(self, errors: FloatArray) -> FloatArray:
        """(..., L) of errors (..., L), m."""
        return np.asarray(self.weights * self.loss(errors / self.sigma)[0])

    def expand(self, errors: FloatArray) -> Expansion:
        """Cost, its slope (1/m) and curvature (1/m^2), each (..., L)."""
        cost, slope, curvature = self.loss(errors / self.sigma)
        return (
            self.weights * cost,
            self.weights * slope / self.sigma,
            self.weights * curvature / self.sigma**2,
        )

    def posterior(self, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A loss knows neither walls nor faults."""
        return np.ones((*errors.shape, 1)), np.zeros_like(errors)


@dataclass(frozen=True, slots=True, eq=False)
class LossModel:
    """The same loss for all links, whatever is in their way."""

    loss: Callable[[FloatArray], Expansion]
    sight_sigma: float
    """m, also of a link that counts in full."""
    anchor_sigma: float
    """m."""

    def cleared(self, anchor_sigma: float) -> LossModel:
        """Least squares with delays of that sigma, m."""
        return replace(self, loss=gaussian, anchor_sigma=anchor_sigma)

    def at(self, poses: Mapping[StationId, Pose2]) -> LossModel:  # noqa: ARG002
        """No walls are asked for."""
        return self

    def as_it_is(self) -> LossModel:
        """There are no walls to keep."""
        return self

    def unlabelled(self, *shape: int) -> FloatArray:
        """(*shape, 1) all links alike."""
        return np.ones((*shape, 1))

    def labels(self, tags: FloatArray, places: FloatArray) -> FloatArray:
        """(..., 1) all links alike."""
        return self.unlabelled(*np.broadcast_shapes(tags.shape, places.shape)[:-1])

    def density(self, labels: FloatArray, sigmas: FloatArray) -> LossDensity:  # noqa: ARG002
        """Of links with sigmas (..., L), m."""
        weights = np.minimum(1.0, (self.sight_sigma / sigmas) ** 2)
        return LossDensity(self.loss, self.sight_sigma, weights)

    def fitted(self, cost: Callable[[LossModel], float]) -> tuple[LossModel, float]:
        """Nothing is learned."""
        return self, cost(self)


@dataclass(frozen=True, slots=True, eq=False)
class FixedModel(LinkModel):
    """The density with the parameters that it starts from."""

    def fitted(self, cost: Callable[[LinkModel], float]) -> tuple[LinkModel, float]:
        """Nothing is learned."""
        return self, cost(self)


@dataclass(frozen=True, slots=True, eq=False)
class OracleModel(LinkModel):
    """The density of links whose number of walls is known; parameters are learned as ever.

    A link is told by its ends: the placed tag and, after bringing the truth to the placed stations,
    the true anchor that are nearest.
    """

    walls: Mapping[tuple[StationId, AnchorId], int] = field(default_factory=dict)
    """On every link; none on those that are not listed."""
    reference: Reference = field(default_factory=lambda: Reference({}, {}))
    tag_offset: tuple[float, float] = (0.0, 0.0)
    """m, the antenna in the scanner's frame."""
    tags: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    """(S, 2) m, of the placed stations."""
    anchors: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    """(A, 2) m, the true ones in the solution's frame."""
    table: FloatArray = field(default_factory=lambda: np.empty((0, 0, 0)))
    """(S, A, W) labels."""

    @property
    def has_map(self) -> bool:
        """It has what a map is for."""
        return True

    def at(self, poses: Mapping[StationId, Pose2]) -> OracleModel:
        """The model that knows the ends of the links where the stations stand now."""
        known = [name for name in poses if name in self.reference.stations]
        world_T_reference = Pose2.identity()
        if len(known) > 1:
            truth = [self.reference.stations[name] for name in known]
            world_T_reference = rigid_alignment(
                np.array([(place.x, place.y) for place in truth]),
                np.array([poses[name].translation for name in known]),
            )
        places = np.array([(p.x, p.y) for p in self.reference.anchors.values()])
        most = self.unlabelled().shape[-1] - 1
        counts = [
            [min(self.walls.get((s, a), 0), most) for a in self.reference.anchors] for s in poses
        ]
        return replace(
            self,
            tags=np.array([pose.transform(np.array(self.tag_offset)) for pose in poses.values()]),
            anchors=world_T_reference.transform(places),
            table=np.eye(most + 1)[np.array(counts)],
        )

    def labels(self, tags: FloatArray, places: FloatArray) -> FloatArray:
        """(..., W) one for the true number of walls, zero for all others."""
        if not len(self.tags):
            return self.unlabelled(*np.broadcast_shapes(tags.shape, places.shape)[:-1])
        return np.asarray(self.table[_nearest(tags, self.tags), _nearest(places, self.anchors)])


def _nearest(points: FloatArray, places: FloatArray) -> FloatArray:
    """(...,) index of the place (K, 2) that is nearest to each point (..., 2)."""
    return np.asarray(np.linalg.norm(points[..., None, :] - places, axis=-1).argmin(axis=-1))
