"""What tells a right match from a wrong one: metres of wall confirmed and looked through, both ways.

A wrong pose may bring as many points together as the right one, but then points of one scan lie
where the other scan looked through: free space is the judge. Walls count by length, not by the
number of points on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.settings import MatchingSettings
from .index import ScanIndex
from .lanes import Lanes, ScanPair, both_ways, in_parts, lanes_both_ways
from .pairing import pair_points

_HIT_M = 0.15  # residuals beyond this confirm nothing
_HIT_SCALE_M = 0.10
_NEAR_M = 0.30  # a point this near to a wall of the other scan does not lie in its free space
_AGREE = 0.7  # cosine between normals that face the same way: two faces of one wall do not confirm each other


@dataclass(frozen=True, slots=True, eq=False)
class PointEvidence:
    """Per candidate pose and point of the moving scan; (L, K, N) of L `Lanes`."""

    hit: FloatArray
    """(K, N) 0-1, how well a wall of the other scan confirms the point."""
    seen_through: FloatArray
    """(K, N) 0-1, how clearly the other scan looked through the place of the point."""


def point_evidence(
    target: ScanIndex | Lanes,
    source: ScanIndex | Lanes,
    poses: FloatArray,
    settings: MatchingSettings,
    stride: int = 1,
) -> PointEvidence:
    """Judge the points of `source` by the walls and the free space of `target` at poses target_T_source (K, 3).

    `Lanes` stand for both, as in `pair_points`.
    """
    pairing = pair_points(target, source, poses, stride=stride)
    near = pairing.squared < _NEAR_M**2
    squared = pairing.across * pairing.across
    confirmed = (pairing.facing > _AGREE) & (squared < _HIT_M**2)
    confirmed &= near
    squared *= 1.0 / _HIT_SCALE_M**2
    squared += 1.0
    hit = confirmed / squared
    depth = target.free_range(pairing.x, pairing.y)
    depth -= np.sqrt(pairing.x * pairing.x + pairing.y * pairing.y)
    # Ramp: just inside the free space a wall's roughness or a small rotation error is enough of an
    # explanation.
    depth *= 1.0 / settings.free_space_margin_m
    depth -= 1.0
    through = np.minimum(np.maximum(depth, 0.0, out=depth), 1.0, out=depth)
    # Clutter is seen from here and missed from there: walls alone contradict.
    through *= source.on_wall[..., ::stride]
    through *= ~near
    return PointEvidence(hit, through)


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Metres of wall of both scans together, for K candidate poses of one pair."""

    confirmed: FloatArray
    """(K,) m that the other scan confirms."""
    through: FloatArray
    """(K,) m that the other scan looked through."""
    total: float
    """m of wall that both scans show."""
    evidence: FloatArray
    """(K,) m, confirmed minus `violation_weight` times looked through."""

    @classmethod
    def joined(cls, scores: Sequence[Scores]) -> Scores:
        """Those of one pair in one; of none, where there are none."""
        confirmed, through, evidence = (
            np.concatenate([np.zeros(0), *(getattr(score, name) for score in scores)])
            for name in ("confirmed", "through", "evidence")
        )
        return cls(confirmed, through, scores[0].total if scores else 0.0, evidence)

    def of(self, chosen: NDArray[np.intp]) -> Scores:
        """Those of some of the poses, by their numbers."""
        return Scores(
            self.confirmed[chosen], self.through[chosen], self.total, self.evidence[chosen]
        )


def score_matches(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    settings: MatchingSettings,
    stride: int = 1,
) -> Scores:
    """Metres of wall confirmed and looked through at poses target_T_source (K, 3), both ways."""
    (scores,) = score_pairs([(target, source)], poses[None], settings, stride)
    return scores


def score_pairs(
    pairs: Sequence[ScanPair], poses: FloatArray, settings: MatchingSettings, stride: int = 1
) -> list[Scores]:
    """The same of Q pairs, each at its poses target_T_source (Q, K, 3)."""
    return [
        scores
        for part in in_parts(len(pairs))
        for scores in score_lanes(lanes_both_ways(pairs[part]), poses[part], settings, stride)
    ]


def score_lanes(
    pairs: Lanes, poses: FloatArray, settings: MatchingSettings, stride: int = 1
) -> list[Scores]:
    """The same of Q pairs in 2 Q lanes, both ways."""
    said = point_evidence(pairs, pairs, both_ways(poses), settings, stride)
    lengths = pairs.lengths[:, 0, ::stride, None] * stride
    ways = (2, *poses.shape[:-1])
    confirmed = (said.hit @ lengths).reshape(ways).sum(axis=0)
    through = (said.seen_through @ lengths).reshape(ways).sum(axis=0)
    total = lengths.reshape(2, len(poses), -1).sum(axis=(0, 2))
    evidence = confirmed - settings.violation_weight * through
    return [
        Scores(*rows[:2], float(rows[2]), rows[3])
        for rows in zip(confirmed, through, total, evidence, strict=True)
    ]
