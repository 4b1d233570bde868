"""The link model: how wrong a range may be, by what the map says of its path.

What the map says is not believed blindly: a share of the links that it calls free are not, and the
reverse. These shares, the delay of a wall and the spread in line of sight are estimated from the
survey's own ranges (`fitted`); the priors are those of the joint study.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logit

from ..model.geometry import FloatArray, Pose2
from ..model.products import WallPieces
from ..model.settings import RangingSettings
from ..model.survey import StationId
from .crossings import count_walls
from .density import MAX_WALLS, ErrorParameters, LinkDensity, error_table
from .descent import descend

FindWalls = Callable[[Mapping[StationId, Pose2]], WallPieces]
"""world_T_station -> the walls that the scans show."""

_MAX_DEVIATION = 3.0
_HIDDEN_SPLIT = np.array([0.0, 0.7, 0.3, 0.0, 0.0])  # walls where the map shows none


@dataclass(frozen=True, slots=True)
class LinkParameters:
    """What a survey's ranges can tell of its links."""

    sight_sigma: float = 0.09
    """m, constant error of a link in line of sight."""
    wall_delay: float = 0.40
    """m, mean delay a wall."""
    anchor_sigma: float = 0.05
    """m, by which the anchors' own delays differ."""
    hidden_share: float = 0.10
    """Share of the links that cross a wall among those that the map calls free."""
    false_share: float = 0.05
    """Share of the free links among those that the map has behind walls."""
    mean_walls: float = 0.5
    """Mean number of walls on a link of which no map speaks."""


@dataclass(frozen=True, slots=True)
class _Prior:
    centre: float
    spread: float
    """Of the logarithm (of the logit, for a share)."""
    is_share: bool = False

    def value(self, z: float) -> float:
        """The parameter `z` standard deviations from the centre."""
        if not self.is_share:
            return float(self.centre * np.exp(self.spread * z))
        return float(expit(logit(self.centre) + self.spread * z))

    def deviation(self, value: float) -> float:
        """The `z` of a value."""
        if self.is_share:
            return float((logit(value) - logit(self.centre)) / self.spread)
        return float(np.log(value / self.centre) / self.spread)


PRIORS = {
    # Tight: links share anchors, so free it would fall below what errors of new links are.
    "sight_sigma": _Prior(0.09, 0.15),
    "wall_delay": _Prior(0.40, 0.5),
    "anchor_sigma": _Prior(0.05, 0.5),
    "hidden_share": _Prior(0.10, 1.2, is_share=True),
    "false_share": _Prior(0.05, 1.2, is_share=True),
    "mean_walls": _Prior(0.5, 1.0),
}
"""Log-normal, logit-normal for shares (joint study, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkModel:
    """Errors of links under one set of parameters and one map."""

    link_sigma: float
    """m, sigma of a measurement that counts in full."""
    find_walls: FindWalls | None = None
    pieces: WallPieces | None = None
    parameters: LinkParameters = LinkParameters()
    clear: bool = False
    """True where all links are taken to be in line of sight: plain Gaussian errors."""

    @property
    def has_map(self) -> bool:
        """Whether the scans show any wall."""
        return self.pieces is not None and len(self.pieces.ends) > 0

    @property
    def sight_sigma(self) -> float:
        """m, of the constant error of a link in line of sight."""
        return self.parameters.sight_sigma

    @property
    def anchor_sigma(self) -> float:
        """m, by which the anchors' own delays differ."""
        return self.parameters.anchor_sigma

    def cleared(self, anchor_sigma: float) -> LinkModel:
        """The model that knows of no walls and no reflections, and of delays of that sigma, m."""
        parameters = replace(self.parameters, anchor_sigma=anchor_sigma)
        return replace(self, clear=True, parameters=parameters)

    def at(self, poses: Mapping[StationId, Pose2]) -> LinkModel:
        """The model with the walls as stations at `poses` (world_T_station) see them."""
        return self if self.find_walls is None else replace(self, pieces=self.find_walls(poses))

    def as_it_is(self) -> LinkModel:
        """The model that keeps its walls wherever the stations are, and nothing to find others with."""
        return replace(self, find_walls=None)

    def unlabelled(self, *shape: int) -> FloatArray:
        """(*shape, W) labels of links of which no map speaks: NaN."""
        return np.full((*shape, MAX_WALLS + 1), np.nan)

    def labels(self, tags: FloatArray, places: FloatArray) -> FloatArray:
        """(..., W) what the map says of the walls between tags (..., 2) and places (..., 2), m."""
        if not self.has_map or self.pieces is None:
            return self.unlabelled(*np.broadcast_shapes(tags.shape, places.shape)[:-1])
        return count_walls(self.pieces, tags, places)

    def density(self, labels: FloatArray, sigmas: FloatArray) -> LinkDensity:
        """Density of the errors of links (..., L) with labels (..., L, W) and sigmas (..., L), m.

        A sigma above that of a plain link makes a link count less; infinity, not at all.
        """
        p = self.parameters
        errors = ErrorParameters(p.sight_sigma, p.wall_delay)
        if self.clear:
            # Not even few reflections: they would shift the peak, and exact ranges would not be met.
            errors = replace(errors, reflected_share=0.0)
        weights = np.minimum(1.0, (self.link_sigma / sigmas) ** 2)
        return LinkDensity(error_table(errors), self._believed(labels), weights)

    def fitted(self, cost: Callable[[LinkModel], float]) -> tuple[LinkModel, float]:
        """The model with the parameters of least `cost` (negative log evidence) and priors, and that cost."""
        return _fit(self, cost)

    def _believed(self, labels: FloatArray) -> FloatArray:
        """(..., W) the map's labels with its mistakes mixed in; Poisson where there is no map."""
        if self.clear:
            return np.broadcast_to(np.eye(MAX_WALLS + 1)[0], labels.shape)
        p = self.parameters
        free, blocked = labels[..., :1], labels.copy()
        blocked[..., 0] = 0.0
        mixed = (1.0 - p.false_share) * blocked + p.hidden_share * free * _HIDDEN_SPLIT
        mixed[..., :1] += (1.0 - p.hidden_share) * free + p.false_share * (1.0 - free)
        count = np.arange(MAX_WALLS + 1)
        poisson = p.mean_walls**count / np.cumprod(np.maximum(count, 1))
        return np.asarray(np.where(np.isnan(mixed), poisson / poisson.sum(), mixed))


def link_model(settings: RangingSettings, find_walls: FindWalls | None = None) -> LinkModel:
    """The model of a survey's links before anything is known of them.

    Args:
        settings: noise of a plain link.
        find_walls: the walls that the scans show, for stations at given poses; None without scans.
    """
    return LinkModel(settings.link_sigma_m, find_walls)


def _fit(model: LinkModel, cost: Callable[[LinkModel], float]) -> tuple[LinkModel, float]:
    """The parameters of least cost, each a number of standard deviations from its prior's centre."""
    # What no link depends on stays where it is.
    idle = {"mean_walls"} if model.has_map else {"hidden_share", "false_share"}
    names = ["sight_sigma"] if model.clear else [name for name in PRIORS if name not in idle]

    def changed(z: FloatArray) -> LinkModel:
        values = {n: PRIORS[n].value(float(v)) for n, v in zip(names, z, strict=True)}
        return replace(model, parameters=replace(model.parameters, **values))

    def penalised(z: FloatArray) -> float:
        return cost(changed(z)) + 0.5 * float(z @ z)

    start = np.array([PRIORS[n].deviation(getattr(model.parameters, n)) for n in names])
    z, least = descend(penalised, start, _MAX_DEVIATION)
    return changed(z), least
