"""Where the anchors may be: each a mixture of normal densities.

One for an anchor with a place, one for each place that the ranges do not tell apart, and a ring of
them for an anchor that too few stations heard.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from ..model.solution import AnchorEstimate, Solution

_ONE_PLACE_M = 0.2
"""Standard deviation of one of several places, where none is given."""
_ON_RING, _ARCS = 180, 20
_RING_SIGMA_M = 0.5
"""Loose: walls make some ranges too long by decimetres."""
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Beliefs:
    """The C places where the A anchors may be."""

    means: Points
    """(C, 2) m."""
    covariances: FloatArray
    """(C, 2, 2) m^2, if the anchor is at this place."""
    shares: FloatArray
    """(C,) of belief; those of one anchor add up to one."""
    owners: NDArray[np.int64]
    """(C,) number of the anchor, 0 to A - 1."""
    rises: FloatArray
    """(C,) m, of the anchor above the tag."""
    rivals: NDArray[np.int64]
    """(R, 2) pairs of places of one anchor."""

    @property
    def spreads(self) -> FloatArray:
        """(R,) m^2 that each pair of places adds to its anchor's variance while nothing tells them apart."""
        i, j = self.rivals.T
        apart = ((self.means[i] - self.means[j]) ** 2).sum(axis=1)
        return np.asarray(self.shares[i] * self.shares[j] * apart)


def build_beliefs(solution: Solution) -> Beliefs | None:
    """Of the anchors whose height is known and that anybody heard; None where there is none."""
    tags = list(solution.tag_heights.values())
    level = float(np.mean(tags)) if tags else 0.0
    rows = [
        (mean, covariance, share, owner, height - level)
        for owner, (height, places) in enumerate(_mixtures(solution))
        for mean, covariance, share in places
    ]
    if not rows:
        return None
    means, covariances, shares, owners, rises = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    pairs = [(i, j) for i, j in combinations(range(len(rows)), 2) if owners[i] == owners[j]]
    rivals = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return Beliefs(means, covariances, shares, owners, rises, rivals)


_Place = tuple[FloatArray, FloatArray, float]
"""Mean, covariance and share."""


def _mixtures(solution: Solution) -> Iterator[tuple[float, list[_Place]]]:
    """Height and places of each anchor."""
    for anchor in solution.anchors:
        places = _places(anchor) or _ring(anchor, solution)
        if anchor.height is not None and places:
            yield anchor.height, places


def _places(anchor: AnchorEstimate) -> list[_Place]:
    """All places that are not excluded."""
    covariance = _ONE_PLACE_M**2 * np.eye(2) if anchor.covariance is None else anchor.covariance
    if not np.isfinite(covariance).all():
        return []
    means = [np.array([other.x, other.y]) for other in anchor.alternatives]
    weights = [other.weight for other in anchor.alternatives]
    if anchor.position is not None:
        means.append(np.asarray(anchor.position))
        weights.append(max(1.0 - sum(weights), _LEAST_SHARE))
    total = sum(weights)
    firm = np.asarray(covariance) + 1e-8 * np.eye(2)
    return [(m, firm, weight / total) for m, weight in zip(means, weights, strict=True)]


def _ring(anchor: AnchorEstimate, solution: Solution) -> list[_Place]:
    """Places of an anchor that too few stations heard: on the rings round those that did.

    None of an anchor that nobody heard: nothing says where to look for it.
    """
    poses = {s.id: s.pose for s in solution.stations if s.pose is not None}
    heard = [
        (poses[link.station].translation, link.distance)
        for link in solution.links
        if link.anchor == anchor.id and link.station in poses and link.distance > 0.0
    ]
    if not heard:
        return []
    angles = np.linspace(0.0, 2.0 * np.pi, _ON_RING, endpoint=False)
    centre, radius = heard[0]
    ring = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    misfits = [(np.linalg.norm(ring - c, axis=1) - r) / _RING_SIGMA_M for c, r in heard[1:]]
    share = np.exp(-0.5 * np.sum(np.square(misfits), axis=0)) + 1e-9 * np.ones(_ON_RING)
    share /= share.sum()
    arcs = [_arc(ring[part], share[part]) for part in np.split(np.arange(_ON_RING), _ARCS)]
    return _of_one([arc for arc in arcs if arc[2] > _LEAST_SHARE])


def _arc(points: Points, share: FloatArray) -> _Place:
    total = float(share.sum())
    mean = share @ points / total
    away = points - mean
    scatter = (away * share[:, None]).T @ away / total
    return mean, scatter + _RING_SIGMA_M**2 * np.eye(2), total


def _of_one(places: Sequence[_Place]) -> list[_Place]:
    total = sum(share for _, _, share in places)
    return [(mean, covariance, share / total) for mean, covariance, share in places]
