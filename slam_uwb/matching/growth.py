"""Blocks of stations as they grow, and which two of them to merge next."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Protocol

from ..model.products import ScanMatch
from ..model.survey import StationId
from .evidence import Block, single_block
from .index import ScanIndex
from .merging import Merge

BlockPair = tuple[int, int]
"""Numbers of two blocks, the smaller first."""


class BestMerge(Protocol):
    """`best_merge` for the scans and hypotheses at hand."""

    def __call__(self, a: Block, b: Block, *, apart: float = 0.0) -> Merge | None:
        """The best way to merge two blocks."""


@dataclass(slots=True, eq=False)
class Growth:
    """Blocks, and what is known of how to merge them.

    Both queues may hold pairs of blocks that are no more; they are passed over.
    """

    blocks: dict[int, Block]
    beside: dict[int, set[int]]
    """Blocks that hypotheses join to each block."""
    priority: dict[BlockPair, float]
    """Of pairs that can be merged; of those not looked at since one of them grew, what its parts had."""
    ready: list[tuple[float, float, int, BlockPair, Merge]] = field(default_factory=list)
    """Pairs that can be merged: negative priority and margin, order."""
    unseen: list[tuple[float, int, BlockPair]] = field(default_factory=list)
    """Pairs to be looked at: negative priority, order."""
    order: count[int] = field(default_factory=count)

    def add_unseen(self, pair: BlockPair, priority: float) -> None:
        """Have a pair looked at when its priority comes first."""
        self.priority[pair] = priority
        heapq.heappush(self.unseen, (-priority, next(self.order), pair))

    def ask_again(self) -> None:
        """Have all pairs that hypotheses join looked at."""
        for one in sorted(self.beside):
            for other in sorted(self.beside[one]):
                if one < other:
                    self.add_unseen((one, other), math.inf)

    def replace(self, old: BlockPair, new: Block) -> None:
        """Put a block in place of two; how it merges with others is looked at when that comes first."""
        number = max(self.blocks) + 1
        self.blocks[number] = new
        self.beside[number] = set()
        for other in sorted((self.beside[old[0]] | self.beside[old[1]]) - {*old}):
            parts = [(min(other, part), max(other, part)) for part in old]
            self.add_unseen((other, number), max(self.priority.pop(p, 0.0) for p in parts))
            self.beside[other] = self.beside[other] - {*old} | {number}
            self.beside[number].add(other)
        for part in old:
            del self.blocks[part], self.beside[part]

    def move(self, number: int, block: Block) -> None:
        """Put a block's stations elsewhere; how it merges with others is looked at again."""
        self.blocks[number] = block
        for other in sorted(self.beside[number]):
            self.add_unseen((min(other, number), max(other, number)), math.inf)

    def next_merge(self, best: BestMerge) -> tuple[BlockPair, Merge] | None:
        """The pair to be merged first; looks at pairs until none unseen may come before it."""
        while True:
            self._pass_over()
            if not self.unseen or (self.ready and self.ready[0][0] < self.unseen[0][0]):
                return self.ready[0][3:] if self.ready else None
            pair = heapq.heappop(self.unseen)[-1]
            self.priority.pop(pair, None)
            merge = best(self.blocks[pair[0]], self.blocks[pair[1]])
            if merge is not None:
                self.priority[pair] = merge.priority
                entry = (-merge.priority, -merge.margin, next(self.order), pair, merge)
                heapq.heappush(self.ready, entry)

    def _pass_over(self) -> None:
        """Drop from the heads of the queues what is no more."""
        while self.ready and not {*self.ready[0][3]} <= self.blocks.keys():
            heapq.heappop(self.ready)
        while self.unseen and not {*self.unseen[0][2]} <= self.blocks.keys():
            heapq.heappop(self.unseen)


def all_apart(scans: Mapping[StationId, ScanIndex], hypotheses: Sequence[ScanMatch]) -> Growth:
    """Every station a block, and no two of them to be looked at yet."""
    number = {station: index for index, station in enumerate(scans)}
    joined = {tuple(sorted((number[m.target], number[m.source]))) for m in hypotheses}
    growth = Growth(
        {number[station]: single_block(station, scan) for station, scan in scans.items()},
        {index: set() for index in number.values()},
        {},
    )
    for a, b in sorted(joined):
        growth.beside[a].add(b)
        growth.beside[b].add(a)
    return growth
