"""Two blocks of stations: the ways to merge them, and by how much one of them is the best."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import compose, first_of_each, near, wrapped
from .correspondences import correspondences
from .crossing import crossing
from .evidence import STRIDE, Block
from .gain import merge_gains
from .index import ScanIndex
from .refiners.point_to_line import damped_step, limited, normal_equations

_SAME_M, _SAME_RAD = 0.35, 0.09  # candidates closer than this are one place
_DISTINCT_M, _DISTINCT_RAD = 0.5, 0.15  # a rival must be further away than this
_LEAST_SUPPORT_M = 0.1  # of wall, that a hypothesis of next to no evidence still brings
_ENOUGH_M = 8.0  # of wall, beyond which a fit tells of equal rooms as much as of the same room
_HOPELESS_M = 40.0  # of wall looked through: centimetres of settling cannot mend it
_LONGEST_STEP_M = 0.2

RangeGain = Callable[[Mapping[StationId, Pose2], Mapping[StationId, Pose2], FloatArray], FloatArray]
"""(a_T_station, b_T_station, candidates a_T_b (K, 3)) -> (K,) log likelihood ratio of the ranges."""

Touching = Mapping[StationId, Sequence[ScanMatch]]
"""All hypotheses that touch each station."""


def no_ranges(
    _a: Mapping[StationId, Pose2], _b: Mapping[StationId, Pose2], candidates: FloatArray
) -> FloatArray:
    """Ranges that say nothing."""
    return np.zeros(len(candidates))


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """The best way to merge two blocks, and by how much it is the best."""

    a_T_b: FloatArray
    """(3,)"""
    margin: float
    """By how much its evidence exceeds that of every other way, to leave the blocks apart included."""
    priority: float
    """The same with walls counting no more than `_ENOUGH_M`: beyond, the ranges decide which merge
    comes first."""


def best_merge(
    a: Block,
    b: Block,
    scans: Mapping[StationId, ScanIndex],
    touching: Touching,
    settings: MatchingSettings,
    range_gain: RangeGain,
    *,
    apart: float = 0.0,
    most: int | None = None,
) -> Merge | None:
    """The best relative pose of two blocks; None where no hypothesis joins them by a margin.

    To leave the blocks apart is a rival too, with the gain `apart`, m. At `most` so many places are looked
    at, those with most support; all of them where None.
    """
    candidates = merge_candidates(a, b, touching, most=most)
    if not len(candidates):
        return None
    candidates, gains = aligned_gains(a, b, candidates, scans, settings)
    # What the walls deny, no range can save: ranges choose among what the walls allow.
    allowed = gains >= apart + settings.min_margin_m
    if not allowed.any():
        return None
    candidates = candidates[allowed]
    ranges = settings.range_weight_m * range_gain(a.poses, b.poses, candidates)
    gains = gains[allowed] + ranges
    best = int(np.argmax(gains))
    rivals = gains[distant(candidates, candidates[best], _DISTINCT_M, _DISTINCT_RAD)]
    margin = float(gains[best] - rivals.max(initial=apart))
    if margin < settings.min_margin_m:
        return None
    walls = margin - float(ranges[best])
    return Merge(candidates[best], margin, min(walls, _ENOUGH_M) + float(ranges[best]))


def distant(
    poses: FloatArray, pose: FloatArray, metres: float, radians: float
) -> NDArray[np.bool_]:
    """(K,) which of the poses (K, 3) are another place than `pose` (3,), not the same one less refined."""
    away = np.hypot(*(poses[:, :2] - pose[:2]).T)
    turned = np.abs(wrapped(poses[:, 2] - pose[2]))
    return np.asarray((away > metres) | (turned > radians))


def touching_stations(hypotheses: Sequence[ScanMatch]) -> Touching:
    """The hypotheses by station, each under both of its own."""
    touching: dict[StationId, list[ScanMatch]] = {}
    for match in hypotheses:
        touching.setdefault(match.target, []).append(match)
        touching.setdefault(match.source, []).append(match)
    return touching


def merge_candidates(
    a: Block, b: Block, touching: Touching, *, most: int | None = None
) -> FloatArray:
    """(K, 3) distinct a_T_b by the hypotheses between their stations, those with most support first."""
    joining = tuple(_joining(a, b, touching))
    if not joining:
        return np.zeros((0, 3))
    poses = np.array([a_T_b.vector for a_T_b, _ in joining])
    score = np.array([match.score for _, match in joining])
    slides = np.array([match.degenerate for _, match in joining])
    # Compare where the blocks' stations come to lie, not the origins: a turn moves distant
    # stations.
    centre = np.mean([pose.translation for pose in b.poses.values()], axis=0)
    places = compose(poses, np.array([*centre, 0.0]))
    same = near(places, _SAME_M, _SAME_RAD)
    support = same @ np.maximum(score, _LEAST_SUPPORT_M)
    # Of one place, what walls hold in every direction comes before what may have slid along some.
    order = np.lexsort((-score, slides, -np.round(support, 9)))
    return poses[first_of_each(order, same, len(order) if most is None else most)]


def _joining(a: Block, b: Block, touching: Touching) -> Iterator[tuple[Pose2, ScanMatch]]:
    """a_T_b by each hypothesis between their stations, and the hypothesis."""
    smaller, other = (a.poses, b.poses) if len(a.poses) < len(b.poses) else (b.poses, a.poses)
    for station in smaller:
        for match in touching.get(station, ()):
            if (match.source if match.target == station else match.target) not in other:
                continue
            if match.target in a.poses:
                i, j, i_T_j = match.target, match.source, match.target_T_source
            else:
                i, j, i_T_j = match.source, match.target, match.target_T_source.inverse()
            yield a.poses[i] @ i_T_j @ b.poses[j].inverse(), match


def aligned_gains(
    a: Block,
    b: Block,
    candidates: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> tuple[FloatArray, FloatArray]:
    """Candidates a_T_b (J, 3) that the walls do not rule out, settled on each other, and their gains (J,)."""
    gains = merge_gains(a, b, candidates, scans, settings, least=-_HOPELESS_M)
    candidates = align_blocks(a, b, candidates[gains > -_HOPELESS_M], scans)
    return candidates, merge_gains(a, b, candidates, scans, settings)


def align_blocks(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> FloatArray:
    """Let the walls of both blocks settle on each other: point-to-line steps over all their scans at once."""
    for gate in (0.4, 0.2):
        hessian = np.zeros((len(candidates), 3, 3))
        gradient = np.zeros((len(candidates), 3))
        for crossed in crossing(a, b, candidates, scans):
            both = crossed.lanes(scans)
            rows = correspondences(both, both, crossed.i_T_j, gate=gate, stride=STRIDE)
            own_hessian, own_gradient = (
                by_witness.sum(axis=0) for by_witness in normal_equations(rows, 0.3 * gate)
            )
            # A motion of the block is one of each of its stations in that station's axes.
            adjoint = crossed.b_T_j.inverse().adjoint()
            hessian[crossed.numbers] += adjoint.T @ own_hessian @ adjoint
            gradient[crossed.numbers] += own_gradient @ adjoint
        candidates = compose(candidates, limited(damped_step(hessian, gradient), _LONGEST_STEP_M))
    return candidates
