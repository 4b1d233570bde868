"""Parts of a block as if the others had never been there: who says what of whose walls, kept apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

import numpy as np

from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .crossing import crossing
from .evidence import Block, Seen
from .gain import said_of_second
from .index import ScanIndex


def seen_by_each(
    block: Block, scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> dict[StationId, dict[StationId, Seen]]:
    """What each station of the block (inner key) says of the points of each other (outer key)."""
    seen: dict[StationId, dict[StationId, Seen]] = {station: {} for station in block.poses}
    for crossed in crossing(block, block, np.zeros((1, 3)), scans):
        said = said_of_second(crossed, scans, settings)
        for i, (hit,), (through,) in zip(
            crossed.witnesses, said.hit, said.seen_through, strict=True
        ):
            if i != crossed.j:
                seen[crossed.j][i] = Seen(hit, hit, through)
    return seen


def part_of(
    block: Block,
    members: Set[StationId],
    seen: Mapping[StationId, Mapping[StationId, Seen]],
) -> Block:
    """Some stations of the block, in its frame, as if the others had never been there."""
    kept = np.array([row for row, station in enumerate(block.poses) if station in members])
    return Block(
        {station: pose for station, pose in block.poses.items() if station in members},
        {
            j: block.seen[j]
            if seen[j].keys() <= members
            else _together([said for i, said in seen[j].items() if i in members], block.seen[j])
            for j in block.poses
            if j in members
        },
        block.sights[kept],
    )


def _together(said: Sequence[Seen], like: Seen) -> Seen:
    """What some witnesses say together."""
    if not said:
        nothing = np.zeros_like(like.hits)
        return Seen(nothing, nothing, nothing)
    return Seen(
        np.sum([values.hits for values in said], axis=0),
        np.max([values.best for values in said], axis=0),
        np.sum([values.through for values in said], axis=0),
    )
