"""Which matches hold together: place all stations so that the merged map has the most evidence.

Sums of pair scores mislead: a wrong wall is counted once for every scan that saw it. Here every
wall counts once, however many scans confirm it, and blocks of stations are merged where the gain in
evidence exceeds that of every other way to merge them by a margin. What no margin supports stays
apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.products import Progress, ScanMatch, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import compose
from .evidence import STRIDE, Block, crossing, merge_blocks, merge_gains, single_block
from .index import ScanIndex
from .refiners.point_to_line import correspondences, damped_step

_SAME_M, _SAME_RAD = 0.35, 0.09  # candidates closer than this are one place
_DISTINCT_M, _DISTINCT_RAD = 0.5, 0.15  # a rival must be further away than this
_CANDIDATES = 10
_ENOUGH_M = 8.0


RangeGain = Callable[[Mapping[StationId, Pose2], Mapping[StationId, Pose2], FloatArray], FloatArray]
"""(a_T_station, b_T_station, candidates a_T_b (K, 3)) -> (K,) log likelihood ratio of the ranges."""


def no_ranges(
    _a: Mapping[StationId, Pose2], _b: Mapping[StationId, Pose2], candidates: FloatArray
) -> FloatArray:
    """Ranges that say nothing."""
    return np.zeros(len(candidates))


@dataclass(frozen=True, slots=True, eq=False)
class _Merge:
    """The best way to merge two blocks, and by how much it is the best."""

    a_T_b: FloatArray
    """(3,)"""
    margin: float
    """By how much its evidence exceeds that of every other way, to leave the blocks apart included."""
    priority: float
    """The same with walls counting no more than `_ENOUGH_M`: beyond, a fit tells of equal rooms as
    much as of the same room, and the ranges decide which merge comes first."""


def place_stations(
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
    *,
    range_gain: RangeGain = no_ranges,
    progress: Progress = silent,
) -> tuple[Block, ...]:
    """Merge stations into blocks that hold together, the largest first.

    Args:
        scans: Every station that has one, in the survey's order.
        hypotheses: All of all pairs.
        settings: `violation_weight` and `min_margin_m` (metres of wall, each counted once).
        range_gain: What the ranges say of a way to merge two blocks, nats.
        progress: Told after each merge.

    Returns:
        Blocks by number of stations, then in the survey's order; a station that nothing holds is a
        block alone.
    """
    blocks = {index: single_block(station, scans[station]) for index, station in enumerate(scans)}
    touching = touching_stations(hypotheses)
    merges = {pair: _best_merge(blocks[pair[0]], blocks[pair[1]], scans, touching, settings, range_gain)
              for pair in combinations(blocks, 2)}  # fmt: skip
    count = len(blocks)
    while True:
        ready = {
            pair: merge
            for pair, merge in merges.items()
            if merge and merge.margin >= settings.min_margin_m
        }
        if not ready:
            break
        (a, b), merge = max(ready.items(), key=lambda item: (item[1].priority, item[1].margin))
        new = max(blocks) + 1
        merged = merge_blocks(blocks.pop(a), blocks.pop(b), merge.a_T_b, scans, settings)
        merges = {pair: kept for pair, kept in merges.items() if not {a, b} & set(pair)}
        merges |= {
            (old, new): _best_merge(block, merged, scans, touching, settings, range_gain)
            for old, block in blocks.items()
        }
        blocks[new] = merged
        progress("placing stations", count - len(blocks), count - 1)
    order = {station: index for index, station in enumerate(scans)}
    return tuple(
        sorted(
            blocks.values(), key=lambda block: (-len(block.poses), order[next(iter(block.poses))])
        )
    )


def _best_merge(
    a: Block,
    b: Block,
    scans: Mapping[StationId, ScanIndex],
    touching: Touching,
    settings: MatchingSettings,
    range_gain: RangeGain,
) -> _Merge | None:
    """The relative pose of two blocks with the highest gain in evidence; None where no hypothesis joins them."""
    candidates = merge_candidates(a, b, touching)
    if not len(candidates):
        return None
    candidates = align_blocks(a, b, candidates, scans)
    gains = merge_gains(a, b, candidates, scans, settings)
    # What the walls deny, no range can save: ranges choose among what the walls allow.
    allowed = gains >= settings.min_margin_m
    if not allowed.any():
        return None
    candidates = candidates[allowed]
    ranges = settings.range_weight_m * range_gain(a.poses, b.poses, candidates)
    gains = gains[allowed] + ranges
    best = int(np.argmax(gains))
    rivals = gains[distant(candidates, candidates[best], _DISTINCT_M, _DISTINCT_RAD)]
    # To leave them apart is a rival too, with a gain of nothing.
    margin = float(gains[best] - max(rivals.max(initial=0.0), 0.0))
    walls = margin - float(ranges[best])
    return _Merge(candidates[best], margin, min(walls, _ENOUGH_M) + float(ranges[best]))


def distant(
    poses: FloatArray, pose: FloatArray, metres: float, radians: float
) -> NDArray[np.bool_]:
    """(K,) which of the poses (K, 3) are another place than `pose` (3,), not the same one less refined."""
    away = np.hypot(*(poses[:, :2] - pose[:2]).T)
    turned = np.abs(np.remainder(poses[:, 2] - pose[2] + np.pi, 2.0 * np.pi) - np.pi)
    return np.asarray((away > metres) | (turned > radians))


Touching = Mapping[StationId, Sequence[ScanMatch]]
"""All hypotheses that touch each station."""


def touching_stations(hypotheses: Sequence[ScanMatch]) -> Touching:
    """The hypotheses by station, each under both of its own."""
    touching: dict[StationId, list[ScanMatch]] = {}
    for match in hypotheses:
        touching.setdefault(match.target, []).append(match)
        touching.setdefault(match.source, []).append(match)
    return touching


def merge_candidates(a: Block, b: Block, touching: Touching) -> FloatArray:
    """(K, 3) distinct a_T_b by the hypotheses between their stations, those with most support first."""
    poses, scores = [], []
    smaller, other = (a.poses, b.poses) if len(a.poses) < len(b.poses) else (b.poses, a.poses)
    for station in smaller:
        for match in touching.get(station, ()):
            if (match.source if match.target == station else match.target) not in other:
                continue
            if match.target in a.poses:
                a_T_target, b_T_source = a.poses[match.target], b.poses[match.source]
                a_T_b = a_T_target @ match.target_T_source @ b_T_source.inverse()
            else:
                a_T_source, b_T_target = a.poses[match.source], b.poses[match.target]
                a_T_b = a_T_source @ match.target_T_source.inverse() @ b_T_target.inverse()
            poses.append(a_T_b.vector)
            scores.append(match.score)
    if not poses:
        return np.zeros((0, 3))
    stack, score = np.array(poses), np.array(scores)
    # Compare where the blocks' stations come to lie, not the origins: a turn moves distant
    # stations.
    centre = np.mean([pose.translation for pose in b.poses.values()], axis=0)
    place = compose(stack, np.tile([*centre, 0.0], (len(stack), 1)))
    near = np.hypot(*(place[:, None, :2] - place[None, :, :2]).transpose(2, 0, 1)) < _SAME_M
    near &= (
        np.abs(np.remainder(place[:, None, 2] - place[None, :, 2] + np.pi, 2 * np.pi) - np.pi)
        < _SAME_RAD
    )
    support = near @ np.maximum(score, 0.1)
    chosen: list[int] = []
    free = np.ones(len(stack), dtype=bool)
    for index in np.lexsort((np.arange(len(stack)), -score, -np.round(support, 9))):
        if free[index] and len(chosen) < _CANDIDATES:
            chosen.append(int(index))
            free &= ~near[index]
    return stack[chosen]


def align_blocks(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> FloatArray:
    """Let the walls of both blocks settle on each other: point-to-line steps over all their scans at once."""
    for gate in (0.4, 0.2):
        hessian = np.zeros((len(candidates), 3, 3))
        gradient = np.zeros((len(candidates), 3))
        for i, j, i_T_j, b_T_j in crossing(a, b, candidates, scans):
            residual, jacobian, weight = correspondences(
                scans[i], scans[j], i_T_j, gate=gate, stride=STRIDE
            )
            jacobian = jacobian @ b_T_j.inverse().adjoint()
            weight = weight / (1.0 + (residual / (0.3 * gate)) ** 2)
            weighted = np.swapaxes(jacobian * weight[:, :, None], 1, 2)
            hessian += weighted @ jacobian
            gradient += (weighted @ residual[:, :, None])[:, :, 0]
        step = damped_step(hessian, gradient)
        candidates = compose(candidates, np.clip(step, -0.2, 0.2))
    return candidates
