"""Why each hypothesis that is not used is not."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from ..model.geometry import Pose2
from ..model.products import ScanMatch
from ..model.survey import StationId
from .agreement import placed, same_place
from .pairs import Pair


def with_reasons(
    hypotheses: Sequence[ScanMatch],
    used: Sequence[ScanMatch],
    placement: Mapping[StationId, Pose2],
    denied: Collection[frozenset[StationId]] = (),
) -> tuple[ScanMatch, ...]:
    """All hypotheses pair by pair; the used match takes the place and rank of the hypothesis that it came from.

    `denied` are pairs whose match was left out since it is beside where all others have them.
    """
    by_pair: dict[Pair, list[ScanMatch]] = {}
    for match in hypotheses:
        by_pair.setdefault((match.target, match.source), []).append(match)
    chosen = {(match.target, match.source): match for match in used}
    return tuple(
        row
        for pair in dict.fromkeys([*by_pair, *chosen])
        for row in _pair_rows(
            by_pair.get(pair, []),
            chosen.get(pair),
            placement,
            "fits beside where the other matches have it"
            if frozenset(pair) in denied
            else "too little overlap",
        )
    )


def _pair_rows(
    found: Sequence[ScanMatch],
    used: ScanMatch | None,
    placement: Mapping[StationId, Pose2],
    unused: str,
) -> list[ScanMatch]:
    kept = {} if used is None else {_origin(found, used): used}
    rows = [
        *(
            replace(h, rejection=_reason(h, used, placement, unused))
            for h in found
            if h.rank not in kept
        ),
        *(replace(match, rank=rank) for rank, match in kept.items()),
    ]
    return sorted(rows, key=lambda match: match.rank)


def _origin(found: Sequence[ScanMatch], used: ScanMatch) -> int:
    """Rank of the hypothesis that a used match came from.

    It may come from none: the placement brought the scans together.
    """
    return next(
        (h.rank for h in found if same_place(h.target_T_source, used.target_T_source)), len(found)
    )


def _reason(
    hypothesis: ScanMatch,
    used: ScanMatch | None,
    placement: Mapping[StationId, Pose2],
    unused: str,
) -> str:
    """Why not; `unused` where the placement has the pair there too."""
    target, source = hypothesis.target, hypothesis.source
    for station in (target, source):
        if station not in placement:
            return f"{station} is not placed"
    if used is not None:
        return "another hypothesis of the pair is used"
    agrees = same_place(hypothesis.target_T_source, placed(target, source, placement))
    return unused if agrees else "disagrees with the merged map"
