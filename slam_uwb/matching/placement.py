"""Which matches hold together: place all stations so that the merged map has the most evidence.

Sums of pair scores mislead: a wrong wall is counted once for every scan that saw it. Here every
wall counts once, however many scans confirm it, and blocks of stations are merged where the gain in
evidence exceeds that of every other way to merge them by a margin. What no margin supports stays
apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Pose2
from ..model.products import Progress, ScanMatch, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .batch import compose
from .evidence import (
    STRIDE,
    Block,
    crossing,
    merge_blocks,
    merge_gains,
    single_block,
    total_evidence,
)
from .index import ScanIndex
from .refiners.point_to_line import correspondences, damped_step, limited

_SAME_M, _SAME_RAD = 0.35, 0.09  # candidates closer than this are one place
_DISTINCT_M, _DISTINCT_RAD = 0.5, 0.15  # a rival must be further away than this
_CANDIDATES = 10
_ENOUGH_M = 8.0
_PART_STATIONS = 3  # blocks of fewer stations have not drifted
_DRIFT_M = 10.0  # evidence that drift may cost; at wrong places it is ten times as much

_HOPELESS_M = 40.0
_LONGEST_STEP_M = 0.2

_Pair = tuple[int, int]

RangeGain = Callable[[Mapping[StationId, Pose2], Mapping[StationId, Pose2], FloatArray], FloatArray]
"""(a_T_station, b_T_station, candidates a_T_b (K, 3)) -> (K,) log likelihood ratio of the ranges."""


Settle = Callable[[Mapping[StationId, Pose2]], dict[StationId, Pose2]]
"""Moves stations of one frame to where all their pairs agree best: matches, and a pose graph."""


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


BestMerge = Callable[..., _Merge | None]
"""(a, b, least_gain=...) -> the best way to merge two blocks."""


@dataclass(slots=True, eq=False)
class _Growth:
    """Blocks and what is known of how to merge them."""

    blocks: dict[int, Block]
    merges: dict[_Pair, _Merge]
    """Pairs of blocks that can be merged."""
    unseen: dict[_Pair, float]
    """Pairs not looked at since one of them grew, with the priority that its parts had."""

    def replace(self, old: _Pair, new: Block) -> None:
        """Put a block in place of two; how it merges with others is looked at when that comes first."""
        number = max(self.blocks) + 1
        for part in old:
            del self.blocks[part]
        known = self.unseen | {pair: merge.priority for pair, merge in self.merges.items()}
        self.merges = {pair: merge for pair, merge in self.merges.items() if not {*old} & {*pair}}
        self.unseen = {pair: value for pair, value in self.unseen.items() if not {*old} & {*pair}}
        for other in self.blocks:
            parts = [(min(other, part), max(other, part)) for part in old]
            self.unseen[other, number] = max(known.get(pair, 0.0) for pair in parts)
        self.blocks[number] = new


def place_stations(
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
    *,
    firm: Sequence[ScanMatch] = (),
    range_gain: RangeGain = no_ranges,
    settle: Settle = dict,
    progress: Progress = silent,
) -> tuple[Block, ...]:
    """Merge stations into blocks that hold together, the largest first.

    The merge with the highest priority comes first. Where none is left, parts of the map that have
    drifted are given a second look: merged, settled, and kept if the evidence then holds.

    Args:
        scans: Every station that has one, in the survey's order.
        hypotheses: All of all pairs.
        settings: `violation_weight` and `min_margin_m` (metres of wall, each counted once).
        firm: Matches that merge their stations before all others, whatever the walls say.
        range_gain: What the ranges say of a way to merge two blocks, nats.
        settle: Moves the stations of a block to where all their pairs agree best.
        progress: Told after each merge.

    Returns:
        Blocks by number of stations, then in the survey's order; a station that nothing holds is a
        block alone.
    """
    singles = {index: single_block(station, scans[station]) for index, station in enumerate(scans)}
    growth = _Growth(singles, {}, dict.fromkeys(combinations(singles, 2), math.inf))
    best_merge = partial(
        _best_merge, scans=scans, touching=touching_stations(hypotheses), settings=settings,
        range_gain=range_gain,
    )  # fmt: skip
    for match in firm:
        _merge_firmly(growth, match, scans, settings)
    while True:
        pair = _next_merge(growth, best_merge)
        if pair is not None:
            a, b = (growth.blocks[part] for part in pair)
            merged = merge_blocks(a, b, growth.merges[pair].a_T_b, scans, settings)
        else:
            second = _second_look(growth.blocks, best_merge, scans, settings, settle)
            if second is None:
                break
            pair, merged = second
        growth.replace(pair, merged)
        progress("placing stations", len(scans) - len(growth.blocks), len(scans) - 1)
    order = {station: index for index, station in enumerate(scans)}
    return tuple(
        sorted(
            growth.blocks.values(),
            key=lambda block: (-len(block.poses), min(order[station] for station in block.poses)),
        )
    )


def _merge_firmly(
    growth: _Growth,
    match: ScanMatch,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> None:
    """Merge the blocks of a match's two stations at its pose; nothing where they are one already."""
    holds = {s: number for number, block in growth.blocks.items() for s in block.poses}
    if holds[match.target] == holds[match.source]:
        return
    a, b = growth.blocks[holds[match.target]], growth.blocks[holds[match.source]]
    a_T_b = a.poses[match.target] @ match.target_T_source @ b.poses[match.source].inverse()
    merged = merge_blocks(a, b, a_T_b.vector, scans, settings)
    growth.replace((holds[match.target], holds[match.source]), merged)


def _next_merge(growth: _Growth, best_merge: BestMerge) -> _Pair | None:
    """The pair of blocks to be merged first; looks at pairs again until none unseen may come before it."""
    while True:
        ready = max(
            growth.merges.items(), key=lambda item: (item[1].priority, item[1].margin), default=None
        )
        unseen = max(growth.unseen.items(), key=lambda item: item[1], default=None)
        if unseen is None or (ready is not None and ready[1].priority > unseen[1]):
            return ready[0] if ready is not None else None
        pair = unseen[0]
        del growth.unseen[pair]
        merge = best_merge(growth.blocks[pair[0]], growth.blocks[pair[1]])
        if merge is not None:
            growth.merges[pair] = merge


def _second_look(
    blocks: Mapping[int, Block],
    best_merge: BestMerge,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    settle: Settle,
) -> tuple[_Pair, Block] | None:
    """Two parts of the map that hold together once all their stations may move, and the merged block.

    Small errors add up within a block as it grows, and two large ones then deny each other's walls
    a little at the right place too.
    """
    parts = {
        number: block for number, block in blocks.items() if len(block.poses) >= _PART_STATIONS
    }
    for pair in combinations(parts, 2):
        a, b = (_settled(parts[part], scans, settings, settle) for part in pair)
        merge = best_merge(a, b, least_gain=-_DRIFT_M)
        if merge is None:
            continue
        merged = _settled(merge_blocks(a, b, merge.a_T_b, scans, settings), scans, settings, settle)
        gain = sum(
            sign * total_evidence(block, scans, settings)
            for sign, block in ((1.0, merged), (-1.0, a), (-1.0, b))
        )
        if gain >= settings.min_margin_m:
            return pair, merged
    return None


def _settled(
    block: Block,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    settle: Settle,
) -> Block:
    """The block with its stations moved to where all their pairs agree best."""
    first, *others = settle(block.poses).items()
    moved = single_block(first[0], scans[first[0]])
    for station, pose in others:
        alone = single_block(station, scans[station])
        place = (first[1].inverse() @ pose).vector
        moved = merge_blocks(moved, alone, place, scans, settings)
    return moved


def _best_merge(
    a: Block,
    b: Block,
    scans: Mapping[StationId, ScanIndex],
    touching: Touching,
    settings: MatchingSettings,
    range_gain: RangeGain,
    least_gain: float | None = None,
) -> _Merge | None:
    """The best relative pose of two blocks; None where no hypothesis joins them by a margin.

    With `least_gain` (m, negative) to leave the blocks apart counts as a way to merge them that has
    this gain.
    """
    apart = 0.0 if least_gain is None else least_gain - settings.min_margin_m
    candidates = merge_candidates(a, b, touching)
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
    # To leave them apart is a rival too, with a gain of nothing.
    margin = float(gains[best] - rivals.max(initial=apart))
    if margin < settings.min_margin_m:
        return None
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


def aligned_gains(
    a: Block,
    b: Block,
    candidates: FloatArray,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> tuple[FloatArray, FloatArray]:
    """Candidates a_T_b (J, 3) that the walls do not rule out, settled on each other, and their gains (J,)."""
    gains = merge_gains(a, b, candidates, scans, settings)
    # Centimetres of settling cannot mend metres of wall looked through.
    candidates = align_blocks(a, b, candidates[gains > -_HOPELESS_M], scans)
    return candidates, merge_gains(a, b, candidates, scans, settings)


def align_blocks(
    a: Block, b: Block, candidates: FloatArray, scans: Mapping[StationId, ScanIndex]
) -> FloatArray:
    """Let the walls of both blocks settle on each other: point-to-line steps over all their scans at once."""
    for gate in (0.4, 0.2):
        hessian = np.zeros((len(candidates), 3, 3))
        gradient = np.zeros((len(candidates), 3))
        for pair in crossing(a, b, candidates, scans):
            residual, jacobian, weight = correspondences(
                scans[pair.i], scans[pair.j], pair.i_T_j, gate=gate, stride=STRIDE
            )
            weight = weight / (1.0 + (residual / (0.3 * gate)) ** 2)
            weighted = np.swapaxes(jacobian, 1, 2) * weight[:, None, :]
            # A motion of the block is one of each of its stations in that station's axes.
            adjoint = pair.b_T_j.inverse().adjoint()
            hessian[pair.near] += adjoint.T @ (weighted @ jacobian) @ adjoint
            gradient[pair.near] += (weighted @ residual[:, :, None])[:, :, 0] @ adjoint
        candidates = compose(candidates, limited(damped_step(hessian, gradient), _LONGEST_STEP_M))
    return candidates
