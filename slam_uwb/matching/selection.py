"""Which matches are used: the placement of the stations and the reason why each other hypothesis is not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from ..model.geometry import Pose2
from ..model.products import Progress, ScanMatch, Share, alone, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .ambiguity import Rival, ambiguous_stations, undecided_stations
from .evidence import Block
from .index import ScanIndex
from .merging import RangeGain, no_ranges
from .outliers import worst_outliers
from .pairs import Pair
from .placement import place_stations
from .rejection import with_reasons
from .rematching import leave_free_directions, rematch_pairs, with_firm, within
from .slips import without_slips
from .spanning import in_first_frame, largest_group, spanning_placement

_ROUNDS = 2
_SETTLING = 2  # what a free direction still pulls shrinks by two orders of magnitude each time

Adjust = Callable[[Mapping[StationId, Pose2], Sequence[ScanMatch]], dict[StationId, Pose2]]
"""Moves a placement to where its matches agree best: a pose graph, which another step brings."""


class Rematch(Protocol):
    """`rematch_pairs` for the scans and pairs at hand."""

    def __call__(
        self, placement: Mapping[StationId, Pose2], /, *, until_still: bool = False
    ) -> tuple[ScanMatch, ...]:
        """Matches of all pairs that overlap at a placement."""


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """What holds together."""

    placement: Mapping[StationId, Pose2]
    """world_T_station of the largest group, in the frame of its first station."""
    used: tuple[ScanMatch, ...]
    """At most one a pair, between stations of the placement."""
    matches: tuple[ScanMatch, ...]
    """All hypotheses with rank and reason, the used ones among them."""
    ambiguous: Mapping[StationId, tuple[tuple[Pose2, float], ...]] = field(default_factory=dict)
    """Stations left out since they fit at more than one place: each place in the frame of the
    placement, with its share of belief. No places where the whole map is in doubt."""


def select_matches(
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    pairs: Sequence[Pair],
    settings: MatchingSettings,
    *,
    adjust: Adjust,
    firm: Sequence[ScanMatch] = (),
    range_gain: RangeGain = no_ranges,
    progress: Progress = silent,
    share: Share = alone,
) -> Selection:
    """Choose among the hypotheses as `settings.placement` says.

    `evidence`: the largest block of stations that the merged map holds together; all pairs of it
    that overlap are refined again at the placement, twice, with the pose graph `adjust` in between.
    `sequence`: the best match of every pair, as the paper uses them. `firm` matches are used in any
    case.
    """
    if settings.placement == "sequence":
        return _by_sequence(scans, hypotheses, firm)
    rematch = partial(rematch_pairs, scans, pairs=pairs, settings=settings, firm=firm, share=share)
    blocks = place_stations(
        scans, hypotheses, settings, firm=firm, range_gain=range_gain, progress=progress,
        settle=lambda poses: adjust(poses, rematch(poses)),
    )  # fmt: skip
    if not blocks:
        return Selection({}, (), with_reasons(hypotheses, (), {}))
    doubtful = _doubtful(blocks, scans, hypotheses, settings, range_gain, firm, share)
    block_T_station = without_slips(blocks[0], scans, hypotheses, settings)
    certain = {s: pose for s, pose in block_T_station.items() if s not in doubtful}
    placement, used = _until_still(certain, rematch, adjust)
    placement, used, denied = _without_outliers(placement, used, firm, adjust)
    return Selection(
        placement,
        used,
        with_reasons(hypotheses, used, placement, denied),
        _places(doubtful, block_T_station, placement),
    )


def _by_sequence(
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    firm: Sequence[ScanMatch],
) -> Selection:
    """The best match of every pair, whatever the others say (paper, Algorithm 1)."""
    decided = {match.ends for match in firm}
    best = [h for h in hypotheses if h.rank == 0 and h.ends not in decided]
    used = with_firm(best, firm, scans)
    placement = spanning_placement(tuple(scans), used)
    used = within(placement, used)
    return Selection(placement, used, with_reasons(hypotheses, used, placement))


def _doubtful(
    blocks: Sequence[Block],
    scans: Mapping[StationId, ScanIndex],
    hypotheses: Sequence[ScanMatch],
    settings: MatchingSettings,
    range_gain: RangeGain,
    firm: Sequence[ScanMatch],
    share: Share,
) -> dict[StationId, Rival | None]:
    """Stations of the largest block that may not stand where they do, with their best other place.

    Where the whole map is in doubt these are all of them, those without another place too.
    """
    rivals = ambiguous_stations(blocks[0], scans, hypotheses, settings, range_gain, share)
    # Where somebody said how a station stands to another, it has no other place.
    decided = {station for match in firm for station in match.ends}
    doubtful: dict[StationId, Rival | None] = {
        station: rival for station, rival in rivals.items() if station not in decided
    }
    stations = blocks[0].poses.keys()
    if undecided_stations(blocks, scans, hypotheses, settings) < len(stations):
        return doubtful
    return doubtful | dict.fromkeys(sorted(stations - doubtful.keys()))


def _until_still(
    placement: Mapping[StationId, Pose2], rematch: Rematch, adjust: Adjust
) -> tuple[dict[StationId, Pose2], tuple[ScanMatch, ...]]:
    """A placement refined over all its overlapping pairs until nothing moves, and their matches.

    Matching again and moving the stations by turns; what then no longer connects is left out.
    """
    # Real walls do not meet exactly: a second round still moves stations by millimetres.
    for _ in range(_ROUNDS):
        placement = adjust(placement, rematch(placement))
    used = rematch(placement, until_still=True)
    placement = largest_group(placement, used)
    used = within(placement, used)
    for _ in range(_SETTLING):
        placement, used = _settled(placement, used, adjust)
    return in_first_frame(placement), used


def _without_outliers(
    placement: Mapping[StationId, Pose2],
    used: tuple[ScanMatch, ...],
    firm: Sequence[ScanMatch],
    adjust: Adjust,
) -> tuple[dict[StationId, Pose2], tuple[ScanMatch, ...], frozenset[frozenset[StationId]]]:
    """A still placement and its matches without those that the others deny; the pairs of these."""
    decided = {match.ends for match in firm}
    denied: set[frozenset[StationId]] = set()
    while outliers := worst_outliers(used, placement, decided):
        denied |= outliers
        used = tuple(match for match in used if match.ends not in outliers)
        placement, used = _settled(placement, used, adjust)
    return in_first_frame(placement), used, frozenset(denied)


def _settled(
    placement: Mapping[StationId, Pose2], used: Sequence[ScanMatch], adjust: Adjust
) -> tuple[dict[StationId, Pose2], tuple[ScanMatch, ...]]:
    """A placement where its matches agree best, and these without a say where they are free."""
    placement = adjust(placement, used)
    return placement, tuple(
        leave_free_directions(m, placement[m.target].inverse() @ placement[m.source]) for m in used
    )


def _places(
    doubtful: Mapping[StationId, Rival | None],
    block_T_station: Mapping[StationId, Pose2],
    placement: Mapping[StationId, Pose2],
) -> dict[StationId, tuple[tuple[Pose2, float], ...]]:
    """Both places of every doubtful station in the frame of the placement (of the block, if there is none)."""
    first = next(iter(placement), None)
    world_T_block = (
        Pose2.identity() if first is None else placement[first] @ block_T_station[first].inverse()
    )

    def both(station: StationId, rival: Rival) -> tuple[tuple[Pose2, float], ...]:
        places = (block_T_station[station], rival.own), (rival.pose, rival.evidence)
        return tuple(
            (world_T_block @ pose, evidence / (rival.own + rival.evidence))
            for pose, evidence in places
        )

    return {s: () if rival is None else both(s, rival) for s, rival in doubtful.items()}
