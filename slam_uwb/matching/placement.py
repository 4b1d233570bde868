"""Which matches hold together: place all stations so that the merged map has the most evidence.

Sums of pair scores mislead: a wrong wall is counted once for every scan that saw it. Here every
wall counts once, however many scans confirm it, and blocks of stations are merged where the gain in
evidence exceeds that of every other way to merge them by a margin. What no margin supports stays
apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

from ..model.geometry import Pose2
from ..model.products import Progress, ScanMatch, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .evidence import Block, single_block, total_evidence
from .gain import merge_blocks
from .growth import BestMerge, BlockPair, Growth, all_apart
from .index import ScanIndex
from .merging import RangeGain, best_merge, no_ranges, touching_stations

# The places with most support are nearly always enough. Hundreds of wrong hypotheses join two large blocks,
# though, and some places have more of them than the right one: what is left apart is asked for all.
_PLACES = 10
_PART_STATIONS = 3  # blocks of fewer stations have not drifted
_DRIFT_M = 10.0  # evidence that drift may cost; at wrong places it is ten times as much

Settle = Callable[[Mapping[StationId, Pose2]], dict[StationId, Pose2]]
"""Moves stations of one frame to where all their pairs agree best: matches, and a pose graph."""


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

    The merge with the highest priority comes first. Where none is left, the parts of the map are settled
    and asked again; at last parts that still deny each other are merged, settled, and kept if the evidence
    then holds.

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
    touching = touching_stations(hypotheses)
    growth = all_apart(scans, hypotheses)
    for match in firm:
        _merge_firmly(growth, match, scans, settings)
    settled = partial(_settled, scans=scans, settings=settings, settle=settle)
    for most in (_PLACES, None):
        growth.ask_again()
        best = partial(
            best_merge, scans=scans, touching=touching, settings=settings, range_gain=range_gain, most=most
        )  # fmt: skip
        done: set[int] = set()
        while merged := (
            _next_merge(growth, best, scans, settings)
            or _settled_merge(growth, done, settled, best, scans, settings)
            or _second_look(growth.blocks, best, scans, settings, settled)
        ):
            growth.replace(*merged)
            progress("placing stations", len(scans) - len(growth.blocks), len(scans) - 1)
    return _largest_first(growth.blocks.values(), scans)


def _largest_first(blocks: Iterable[Block], stations: Iterable[StationId]) -> tuple[Block, ...]:
    order = {station: index for index, station in enumerate(stations)}
    return tuple(
        sorted(
            blocks,
            key=lambda block: (-len(block.poses), min(order[station] for station in block.poses)),
        )
    )


def _merge_firmly(
    growth: Growth,
    match: ScanMatch,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> None:
    """Merge the blocks of a match's two stations at its pose; nothing where they are one already."""
    holds = {s: number for number, block in growth.blocks.items() for s in block.poses}
    pair = holds[match.target], holds[match.source]
    if pair[0] == pair[1]:
        return
    a, b = (growth.blocks[part] for part in pair)
    a_T_b = a.poses[match.target] @ match.target_T_source @ b.poses[match.source].inverse()
    growth.replace(pair, merge_blocks(a, b, a_T_b.vector, scans, settings))


def _next_merge(
    growth: Growth,
    best: BestMerge,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> tuple[BlockPair, Block] | None:
    """The two blocks whose merge has the highest priority, merged; None where no two can be."""
    found = growth.next_merge(best)
    if found is None:
        return None
    pair, merge = found
    a, b = (growth.blocks[part] for part in pair)
    return pair, merge_blocks(a, b, merge.a_T_b, scans, settings)


def _settled_merge(
    growth: Growth,
    done: set[int],
    settled: Callable[[Block], Block],
    best: BestMerge,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
) -> tuple[BlockPair, Block] | None:
    """The next merge once the blocks have settled that have grown since they last did, and join others.

    Small errors add up within a block as it grows, and a merge that closes a loop then denies walls at the
    right place too.
    """
    parts = [
        number
        for number, block in growth.blocks.items()
        if number not in done and growth.beside[number] and len(block.poses) >= _PART_STATIONS
    ]
    for number in parts:
        growth.move(number, settled(growth.blocks[number]))
    done.update(parts)
    return _next_merge(growth, best, scans, settings)


def _second_look(
    blocks: Mapping[int, Block],
    best: BestMerge,
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    settled: Callable[[Block], Block],
) -> tuple[BlockPair, Block] | None:
    """Two parts of the map that hold together once all their stations may move, and the merged block."""
    parts = [number for number, block in blocks.items() if len(block.poses) >= _PART_STATIONS]
    evidence = partial(total_evidence, scans=scans, settings=settings)
    for pair in combinations(parts, 2):
        a, b = (blocks[part] for part in pair)
        merge = best(a, b, apart=-_DRIFT_M - settings.min_margin_m)
        if merge is None:
            continue
        merged = settled(merge_blocks(a, b, merge.a_T_b, scans, settings))
        if evidence(merged) - evidence(a) - evidence(b) >= settings.min_margin_m:
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
    return replace(moved, parts=block.parts)
