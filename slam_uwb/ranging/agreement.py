"""Do the ranges of two groups of stations agree that the groups lie like this? No anchor is known.

Each group's ranges to an anchor leave a field of places where the anchor may be. Laid over each
other rightly, the fields of both groups meet; laid wrongly, they miss each other by metres. The
evidence is a ratio of marginal likelihoods, the anchor's place integrated out on a coarse grid, so
that no trilateration and no mirror image is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points, Pose2
from ..model.products import LinkMeasurement
from ..model.survey import AnchorId, StationId, Survey

Poses = Mapping[StationId, Pose2]
RangeGain = Callable[[Poses, Poses, FloatArray], FloatArray]
"""(block_T_station of group a, of group b, candidates a_T_b (K, 3)) -> (K,) log likelihood ratio, nats."""

_CELL_M = 0.5
_AREA_M2 = 400.0  # prior area of an anchor's place: a large flat; a factor two is 0.7 nats
_RELEVANT_NATS = 10.0  # cells less likely than this against the best are left out
_MORE_FIELDS = 64  # kept beside one a station
_UNKNOWN_RISE_M = 1.0  # height difference assumed where an anchor's height is not known

# Density of measured minus true distance, 1/m: line of sight with the offset of uncalibrated radios,
# a tail of walls, and a floor for whatever else (real EVK1000 links: 0.2 m in line of sight, 0.9 m
# and up to 3 m without).
_SIGHT, _SIGHT_MEAN_M, _SIGHT_SIGMA_M = (
    0.55,
    0.2,
    0.3,
)  # sigma: link 0.1, offset 0.1, poses 0.05, cells 0.2
_TAIL, _TAIL_MEAN_M = 0.40, 0.7
_FLOOR = 0.05 / 30.0


@dataclass(frozen=True, slots=True, eq=False)
class _Links:
    """The links of one group to one anchor."""

    places: Points
    """(L, 2) m, the tag in the group's frame."""
    distances: FloatArray
    """(L,) m, slant."""
    rises: FloatArray
    """(L,) m, anchor above tag."""


@dataclass(frozen=True, slots=True, eq=False)
class _Field:
    """Where one group's links leave an anchor."""

    links: _Links
    cells: NDArray[np.float32]
    """(C, 2) m in the group's frame."""
    log_likelihood: NDArray[np.float32]
    """(C,)"""
    log_evidence: float
    """Logarithm of the likelihood averaged over the prior area."""


def range_gain(survey: Survey, links: Sequence[LinkMeasurement]) -> RangeGain:
    """A function that weighs candidate placements of two groups of stations by the ranges of `links`."""
    tags = {station.id: station.tag_height for station in survey.stations}
    heights = {anchor.id: anchor.height for anchor in survey.anchors}
    by_station: dict[StationId, list[LinkMeasurement]] = {}
    for link in links:
        if link.rejection is None:
            by_station.setdefault(link.station, []).append(link)

    # Every group is weighed against many others; those that have been merged are not asked for again.
    @lru_cache(maxsize=len(survey.stations) + _MORE_FIELDS)
    def fields(group: tuple[tuple[StationId, Pose2], ...]) -> dict[AnchorId, _Field]:
        return _fields(dict(group), by_station, tags, heights, survey.tag_offset)

    def gain(a: Poses, b: Poses, candidates: FloatArray) -> FloatArray:
        of_a, of_b = fields(tuple(a.items())), fields(tuple(b.items()))
        total = np.zeros(len(candidates))
        for anchor in of_a.keys() & of_b.keys():
            total += _anchor_gain(of_a[anchor], of_b[anchor], candidates)
        return total

    return gain


def _fields(
    poses: Poses,
    by_station: Mapping[StationId, Sequence[LinkMeasurement]],
    tags: Mapping[StationId, float],
    heights: Mapping[AnchorId, float | None],
    tag_offset: tuple[float, float],
) -> dict[AnchorId, _Field]:
    rows: dict[AnchorId, list[tuple[float, float, float, float]]] = {}
    for station, pose in poses.items():
        x, y = pose.transform(np.array(tag_offset))
        for link in by_station.get(station, ()):
            height = heights[link.anchor]
            rise = _UNKNOWN_RISE_M if height is None else height - tags[station]
            rows.setdefault(link.anchor, []).append((x, y, link.distance, rise))
    return {anchor: _field(np.array(values)) for anchor, values in sorted(rows.items())}


def _field(rows: FloatArray) -> _Field:
    links = _Links(rows[:, :2], rows[:, 2], rows[:, 3])
    # No anchor is further from a station than the shortest range allows, give or take the noise.
    low = (links.places - links.distances[:, None]).max(axis=0) - 1.0
    high = (links.places + links.distances[:, None]).min(axis=0) + 1.0
    high = np.maximum(high, low + _CELL_M)
    axes = [
        np.arange(start, stop + _CELL_M, _CELL_M) for start, stop in zip(low, high, strict=True)
    ]
    cells = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    likelihood = _log_likelihood(links, cells)
    relevant = likelihood > likelihood.max() - _RELEVANT_NATS
    evidence = float(_log_mean(likelihood[relevant]))
    # A station hears some anchors over thousands of cells: in single precision, which is plenty.
    near, nats = (values[relevant].astype(np.float32) for values in (cells, likelihood))
    return _Field(links, near, nats, evidence)


def _anchor_gain(a: _Field, b: _Field, candidates: FloatArray) -> FloatArray:
    """(K,) log evidence of both groups' links together minus that of each alone."""
    if len(a.links.distances) >= len(b.links.distances):
        cells, c, s = a.cells, np.cos(candidates[:, 2:3]), np.sin(candidates[:, 2:3])
        x, y = cells[:, 0] - candidates[:, 0:1], cells[:, 1] - candidates[:, 1:2]
        moved = np.stack([c * x + s * y, c * y - s * x], axis=-1)
        together = a.log_likelihood + _log_likelihood(b.links, moved)
    else:
        cells, c, s = b.cells, np.cos(candidates[:, 2:3]), np.sin(candidates[:, 2:3])
        x = c * cells[:, 0] - s * cells[:, 1] + candidates[:, 0:1]
        y = s * cells[:, 0] + c * cells[:, 1] + candidates[:, 1:2]
        together = b.log_likelihood + _log_likelihood(a.links, np.stack([x, y], axis=-1))
    return _log_mean(together) - a.log_evidence - b.log_evidence


def _log_likelihood(links: _Links, places: Points) -> FloatArray:
    """(...,) of an anchor at `places` (..., 2)."""
    offset = places[..., None, :] - links.places
    predicted = np.sqrt(np.einsum("...d,...d->...", offset, offset) + links.rises**2)
    return np.asarray(_log_density(links.distances - predicted).sum(axis=-1))


def _log_density(error: FloatArray) -> FloatArray:
    whitened = (error - _SIGHT_MEAN_M) / _SIGHT_SIGMA_M
    sight = _SIGHT / (np.sqrt(2.0 * np.pi) * _SIGHT_SIGMA_M) * np.exp(-0.5 * whitened**2)
    beyond = np.maximum(error - _SIGHT_MEAN_M, 0.0)
    tail = np.where(
        error > _SIGHT_MEAN_M, _TAIL / _TAIL_MEAN_M * np.exp(-beyond / _TAIL_MEAN_M), 0.0
    )
    return np.asarray(np.log(sight + tail + _FLOOR))


def _log_mean(log_likelihood: FloatArray) -> FloatArray:
    """(...,) logarithm of the mean over the prior area; the last axis are cells."""
    top = log_likelihood.max(axis=-1, keepdims=True)
    total = np.exp(log_likelihood - top).sum(axis=-1)
    return np.asarray(np.log(total * (_CELL_M**2 / _AREA_M2)) + top[..., 0])
