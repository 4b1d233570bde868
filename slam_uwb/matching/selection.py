"""Which matches are used: the placement of the stations and the reason why each other hypothesis is not."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..model.geometry import Pose2
from ..model.products import Progress, ScanMatch, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .ambiguity import Rival, ambiguous_stations, undecided_stations
from .hypotheses import leave_free_directions, rematch_pairs
from .index import ScanIndex
from .merging import RangeGain, no_ranges
from .pairs import Pair
from .placement import place_stations

Adjust = Callable[[Mapping[StationId, Pose2], Sequence[ScanMatch]], dict[StationId, Pose2]]
"""Moves a placement to where its matches agree best: a pose graph, which another step brings."""

_SAME_M, _SAME_RAD = 0.25, 0.1  # of the used match: the hypothesis that it came from, less refined
_SETTLING = 2  # what a free direction still pulls shrinks by two orders of magnitude each time


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
) -> Selection:
    """Choose among the hypotheses as `settings.placement` says.

    `evidence`: the largest block of stations that the merged map holds together; all pairs of it
    that overlap are refined again at the placement, twice, with the pose graph `adjust` in between.
    `sequence`: the best match of every pair, as the paper uses them. `firm` matches are used in any
    case.
    """
    if settings.placement == "sequence":
        decided = {frozenset((match.target, match.source)) for match in firm}
        best = [
            h for h in hypotheses if h.rank == 0 and frozenset((h.target, h.source)) not in decided
        ]
        used = _with_firm(best, firm, scans)
        placement = spanning_placement(tuple(scans), used)
        used = tuple(match for match in used if match.source in placement)
        return Selection(placement, used, _with_reasons(hypotheses, used, placement))

    def rematch(
        poses: Mapping[StationId, Pose2], *, until_still: bool = False
    ) -> tuple[ScanMatch, ...]:
        found = rematch_pairs(scans, poses, pairs, settings, until_still=until_still)
        return _with_firm(found, firm, poses)

    def settle(poses: Mapping[StationId, Pose2]) -> dict[StationId, Pose2]:
        return adjust(poses, rematch(poses))

    blocks = place_stations(
        scans, hypotheses, settings, firm=firm, range_gain=range_gain, settle=settle,
        progress=progress,
    )  # fmt: skip
    if not blocks:
        return Selection({}, (), _with_reasons(hypotheses, (), {}))
    rivals = ambiguous_stations(blocks[0], scans, hypotheses, settings, range_gain)
    # Where somebody said how a station stands to another, it has no other place.
    decided_stations = {station for match in firm for station in (match.target, match.source)}
    rivals = {s: rival for s, rival in rivals.items() if s not in decided_stations}
    if undecided_stations(blocks, scans, hypotheses, settings) >= len(blocks[0].poses):
        placement, aliased = {}, blocks[0].poses.keys() - rivals
    else:
        placement = {s: pose for s, pose in blocks[0].poses.items() if s not in rivals}
        aliased = set()
    used = rematch(placement)
    for last in (False, True):
        placement = adjust(placement, used)
        used = rematch(placement, until_still=last)
    placement = _largest_group(placement, used)
    used = tuple(match for match in used if match.target in placement and match.source in placement)
    for _ in range(_SETTLING):
        placement = adjust(placement, used)
        used = tuple(
            leave_free_directions(m, placement[m.target].inverse() @ placement[m.source])
            for m in used
        )
    placement = _in_first_frame(placement, {station: k for k, station in enumerate(placement)})
    return Selection(
        placement,
        used,
        _with_reasons(hypotheses, used, placement),
        _places(rivals, blocks[0].poses, placement) | dict.fromkeys(sorted(aliased), ()),
    )


def _with_firm(
    matches: Sequence[ScanMatch], firm: Sequence[ScanMatch], stations: Container[StationId]
) -> tuple[ScanMatch, ...]:
    """The matches, and the firm ones between these stations whose pair is not among them."""
    there = {frozenset((match.target, match.source)) for match in matches}
    missing = [
        replace(match, rejection=None)
        for match in firm
        if match.target in stations
        and match.source in stations
        and frozenset((match.target, match.source)) not in there
    ]
    return (*matches, *missing)


def _places(
    rivals: Mapping[StationId, Rival],
    block_T_station: Mapping[StationId, Pose2],
    placement: Mapping[StationId, Pose2],
) -> dict[StationId, tuple[tuple[Pose2, float], ...]]:
    """Both places of every ambiguous station in the frame of the placement (of the block, if there is none)."""
    first = next(iter(placement), None)
    world_T_block = (
        Pose2.identity() if first is None else placement[first] @ block_T_station[first].inverse()
    )
    return {
        station: (
            (world_T_block @ block_T_station[station], rival.own / (rival.own + rival.evidence)),
            (world_T_block @ rival.pose, rival.evidence / (rival.own + rival.evidence)),
        )
        for station, rival in rivals.items()
    }


def spanning_placement(
    stations: Sequence[StationId], matches: Sequence[ScanMatch]
) -> dict[StationId, Pose2]:
    """Poses of the largest group of stations that the matches connect, along the maximum-score spanning tree.

    The frame is that of the group's first station in the order given.
    """
    order = {station: index for index, station in enumerate(stations)}
    group = {station: {station: Pose2.identity()} for station in stations}
    for match in sorted(
        matches, key=lambda match: (-match.score, order[match.target], order[match.source])
    ):
        a, b = group[match.target], group[match.source]
        if a is b:
            continue
        a_T_b = a[match.target] @ match.target_T_source @ b[match.source].inverse()
        a.update({station: a_T_b @ pose for station, pose in b.items()})
        group.update(dict.fromkeys(b, a))
    return _in_first_frame(
        max(
            group.values(),
            key=lambda poses: (len(poses), -min(order[s] for s in poses)),
            default={},
        ),
        order,
    )


def _largest_group(
    placement: Mapping[StationId, Pose2], used: Sequence[ScanMatch]
) -> dict[StationId, Pose2]:
    """The largest group of stations of a placement that the used matches still connect."""
    stations = tuple(placement)
    connected = spanning_placement(stations, used) if stations else {}
    order = {station: index for index, station in enumerate(stations)}
    return _in_first_frame({station: placement[station] for station in connected}, order)


def _in_first_frame(
    poses: Mapping[StationId, Pose2], order: Mapping[StationId, int]
) -> dict[StationId, Pose2]:
    stations = sorted(poses, key=order.__getitem__)
    first_T_world = poses[stations[0]].inverse() if stations else Pose2.identity()
    return {station: first_T_world @ poses[station] for station in stations}


def _with_reasons(
    hypotheses: Sequence[ScanMatch], used: Sequence[ScanMatch], placement: Mapping[StationId, Pose2]
) -> tuple[ScanMatch, ...]:
    """All hypotheses pair by pair; the used match takes the place and rank of the hypothesis that it came from."""
    by_pair: dict[Pair, list[ScanMatch]] = {}
    for match in hypotheses:
        by_pair.setdefault((match.target, match.source), []).append(match)
    chosen = {(match.target, match.source): match for match in used}
    pairs = [*by_pair, *(pair for pair in chosen if pair not in by_pair)]
    return tuple(
        row
        for pair in pairs
        for row in _pair_rows(by_pair.get(pair, []), chosen.get(pair), placement)
    )


def _pair_rows(
    found: Sequence[ScanMatch], used: ScanMatch | None, placement: Mapping[StationId, Pose2]
) -> list[ScanMatch]:
    origin = None
    if used is not None:
        # A used match may come from no hypothesis: the placement brought the scans together.
        origin = next(
            (h.rank for h in found if _same(h.target_T_source, used.target_T_source)), len(found)
        )
    rows = [
        replace(h, rejection=_reason(h, used, placement)) for h in found if h.rank != origin
    ] + ([replace(used, rank=origin)] if used is not None and origin is not None else [])
    return sorted(rows, key=lambda match: match.rank)


def _same(a: Pose2, b: Pose2) -> bool:
    return a.distance_to(b) < _SAME_M and a.angle_to(b) < _SAME_RAD


def _reason(
    hypothesis: ScanMatch, used: ScanMatch | None, placement: Mapping[StationId, Pose2]
) -> str:
    missing = [s for s in (hypothesis.target, hypothesis.source) if s not in placement]
    if missing:
        return f"{missing[0]} is not placed"
    if used is not None:
        return "another hypothesis of the pair is used"
    placed = placement[hypothesis.target].inverse() @ placement[hypothesis.source]
    near = _same(hypothesis.target_T_source, placed)
    return "too little overlap" if near else "disagrees with the merged map"
