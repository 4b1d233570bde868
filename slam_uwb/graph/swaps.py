"""Are the ranges of two anchors exchanged at a station? Asked of both links at once, with their places open.

A range that was exchanged has drawn its anchor towards itself: the places of both anchors are taken from their
other links alone, as densities on a grid, and each range is judged by what these expect of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points, Vector2
from ..model.link_law import LinkDensity

_REACH, _STEP = 1.5, 0.05
"""m about an anchor's place."""
_NEGLECTED = 15.0
"""nats below the best: such places add nothing."""

Densities = Callable[[NDArray[np.int64]], LinkDensity]
"""Of some of the links, by number."""


@dataclass(frozen=True, slots=True, eq=False)
class AnchorLinks:
    """All links of one anchor."""

    rows: NDArray[np.int64]
    """(N,) numbers among all links."""
    place: Vector2
    """(2,) m, as solved."""
    tags: Points
    """(N, 2) m."""
    rises: FloatArray
    """(N,) m, of the anchor above each tag."""
    distances: FloatArray
    """(N,) m, offset taken off."""
    offset: float
    """m, of the anchor."""


@dataclass(frozen=True, slots=True, eq=False)
class _Belief:
    """Where one anchor may be by its links, each left out in turn."""

    slants: FloatArray
    """(G, N) m, from each place of the grid."""
    total: FloatArray
    """(G,) nats, negative log likelihood by all links."""
    own: FloatArray
    """(G, N) nats, of each link."""
    densities: list[LinkDensity]
    """Of each link alone."""


def swap_gains(anchors: list[AnchorLinks], densities: Densities) -> dict[tuple[int, int], float]:
    """Nats by which the ranges of two links of one station fit better exchanged.

    Args:
        anchors: all placed ones.
        densities: of the errors of links.

    Returns:
        By the numbers of both links, the smaller first; links of the same tag are of one station.
    """
    beliefs = [_believe(links, densities) for links in anchors]
    gains = {}
    for a, b in combinations(range(len(anchors)), 2):
        one, other = anchors[a], anchors[b]
        same = (one.tags[:, None] == other.tags).all(axis=2)
        for i, j in np.argwhere(same):
            numbers = int(one.rows[i]), int(other.rows[j])
            of_one = other.distances[j] + other.offset - one.offset
            of_other = one.distances[i] + one.offset - other.offset
            gain = _gain(beliefs[a], i, of_one) + _gain(beliefs[b], j, of_other)
            gains[min(numbers), max(numbers)] = gain
    return gains


def _believe(links: AnchorLinks, densities: Densities) -> _Belief:
    along = np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    places = links.place + np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    across = places[:, None] - links.tags
    slants = np.sqrt((across**2).sum(axis=2) + links.rises**2)
    own = densities(links.rows).costs(links.distances - slants)
    total = own.sum(axis=1)
    others = total[:, None] - own
    likely = (others - others.min(axis=0) < _NEGLECTED).any(axis=1)
    return _Belief(
        slants[likely], total[likely], own[likely], [densities(row[None]) for row in links.rows]
    )


def _gain(belief: _Belief, link: int, distance: float) -> float:
    """Nats by which `distance` is likelier than the range of the link, as the anchor's other links tell."""
    others = belief.own[:, link] - belief.total
    errors = distance - belief.slants[:, link : link + 1]
    exchanged = others - belief.densities[link].costs(errors)[:, 0]
    return float(np.logaddexp.reduce(exchanged) - np.logaddexp.reduce(-belief.total))
