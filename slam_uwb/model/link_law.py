"""What the solvers need to know of the errors of ranges: `ranging` has it, `pipeline` hands it over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from .geometry import FloatArray, Pose2
from .survey import StationId


class LinkDensity(Protocol):
    """The density of the error (measured minus true minus offset) of each of L links."""

    @property
    def weights(self) -> FloatArray:
        """(..., L) how much each link counts, 0-1."""
        ...

    def costs(self, errors: FloatArray, /) -> FloatArray:
        """(..., L) negative log likelihood of errors (..., L), m."""
        ...

    def expand(self, errors: FloatArray, /) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log likelihood, its slope (1/m) and its curvature (1/m^2), each (..., L)."""
        ...

    def posterior(self, errors: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        """(..., L, W) probability of 0, 1, ... walls after seeing the error, and (..., L) of a fault."""
        ...


class LinkModel(Protocol):
    """Errors of links under one map and one set of parameters; a frozen value."""

    @property
    def sight_sigma(self) -> float:
        """m, of the constant error of a link in line of sight."""
        ...

    @property
    def anchor_sigma(self) -> float:
        """m, by which the anchors' own delays differ."""
        ...

    def cleared(self, anchor_sigma: float, /) -> LinkModel:
        """The model that knows of no walls and no reflections, and of delays of that sigma, m."""
        ...

    def at(self, poses: Mapping[StationId, Pose2], /) -> LinkModel:
        """The model with the walls as stations at `poses` (world_T_station) see them."""
        ...

    def as_it_is(self) -> LinkModel:
        """The model that keeps its walls wherever the stations are, and nothing to find others with."""

    def unlabelled(self, *shape: int) -> FloatArray:
        """(*shape, W) labels of links of which no map speaks."""
        ...

    def labels(self, tags: FloatArray, places: FloatArray, /) -> FloatArray:
        """(..., W) probability of 0, 1, ... walls between tags and places (..., 2), m, by the map."""
        ...

    def density(self, labels: FloatArray, sigmas: FloatArray, /) -> LinkDensity:
        """Density for labels (..., L, W) and sigmas (..., L), m; an infinite sigma counts nothing."""
        ...

    def fitted(self, cost: Callable[[LinkModel], float], /) -> tuple[LinkModel, float]:
        """The model with the parameters of least `cost` (negative log evidence) and priors, and that cost."""
        ...
