"""Stations that slid along walls before there was a scan that could hold them.

A match that leaves a direction free takes its station to anywhere along it. A scan that is merged
later may tell where it belongs, but by then it stands further off than refining reaches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.products import ScanMatch
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .evidence import Block, single_block
from .gain import merge_blocks, merge_gains
from .index import ScanIndex
from .merging import Touching, distant, touching_stations
from .parts import part_of, seen_by_each

_SLIPPED_M, _SLIPPED_RAD = 0.1, 0.05  # nearer, refining finds the place
_BESIDE_M, _BESIDE_RAD = 0.6, 0.2  # further away it is another place, not the same one slid
_TOLD_M = 0.5  # of wall that the other place must have more


def without_slips(
    block: Block,
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
) -> dict[StationId, Pose2]:
    """The block's poses (block_T_station), each station that has slid back where it has more evidence.

    Looked at are places close by to which matches that hold every direction would take a station.
    """
    touching = touching_stations(hypotheses)
    # One after the other: of two that stand apart, either could come to the other.
    stations = tuple(block.poses)
    for _ in stations:
        moved = _one_back(block, scans, touching, settings)
        if moved is None:
            break
        block = moved
    return {station: block.poses[station] for station in stations}


def _one_back(
    block: Block,
    scans: Mapping[StationId, ScanIndex],
    touching: Touching,
    settings: MatchingSettings,
) -> Block | None:
    """The block with that station back which gains most by it; None where none gains enough."""
    beside = {s: _places_beside(s, block, touching.get(s, ())) for s in block.poses}
    if not any(len(places) for places in beside.values()):
        return None
    seen = seen_by_each(block, scans, settings)
    most, moved = _TOLD_M, None
    for station, places in beside.items():
        if not len(places):
            continue
        rest = part_of(block, block.poses.keys() - {station}, seen)
        alone = single_block(station, scans[station])
        places = np.vstack([block.poses[station].vector, places])
        gains = merge_gains(rest, alone, places, scans, settings)
        best = int(np.argmax(gains))
        if gains[best] - gains[0] >= most:
            most = float(gains[best] - gains[0])
            moved = rest, alone, places[best]
    return None if moved is None else merge_blocks(*moved, scans, settings)


def _places_beside(station: StationId, block: Block, matches: Sequence[ScanMatch]) -> FloatArray:
    """(K, 3) block_T_station by the matches that hold every direction, where it is beside the one it has."""
    found = [np.zeros((0, 3))]
    for match in matches:
        if match.degenerate or not match.ends <= block.poses.keys():
            continue
        target_T_source = match.target_T_source
        if match.source == station:
            place = block.poses[match.target] @ target_T_source
        else:
            place = block.poses[match.source] @ target_T_source.inverse()
        found.append(place.vector[None])
    places, own = np.concatenate(found), block.poses[station].vector
    slipped = distant(places, own, _SLIPPED_M, _SLIPPED_RAD)
    return places[slipped & ~distant(places, own, _BESIDE_M, _BESIDE_RAD)]
