"""Which pairs are tried, and matching all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain, combinations

import numpy as np

from ..model.errors import SettingsError
from ..model.geometry import FloatArray
from ..model.products import Kept, PreparedScan, Progress, ScanMatch, Share, alone, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .hypotheses import match_together
from .index import ScanIndex, index_scan
from .lanes import shared_parts

Pair = tuple[StationId, StationId]
"""(m, n): target and source; fit scan n to scan m."""


def candidate_pairs(
    stations: Sequence[StationId],
    sequence: Sequence[Pair] | None,
    settings: MatchingSettings,
    separation: FloatArray | None = None,
) -> tuple[Pair, ...]:
    """Pairs to be matched, in the survey's order.

    `all` takes every pair once, as the sequence orients it; `sequence` those of the sequence alone.
    In surveys of more than `all_pairs_stations` stations pairs that the ranges put further apart
    than `near_by_ranges_m` are left out, so that work grows with the stations and not with their
    square.

    Args:
        stations: Those with a scan.
        sequence: The survey's, if it has one.
        settings: Which pairs.
        separation: (S, S) m, least distance of each two stations as far as ranges tell.

    Raises:
        SettingsError: the sequence is wanted and the survey has none.
    """
    present = set(stations)
    oriented = tuple(pair for pair in sequence or () if present.issuperset(pair))
    if settings.pairs == "sequence":
        if not sequence:
            raise SettingsError(
                "matching.pairs", "is 'sequence', but survey.toml gives no sequence; use 'all'"
            )
        return oriented
    named = set(oriented)
    near = np.ones((len(stations), len(stations)), dtype=bool)
    if separation is not None and len(stations) > settings.all_pairs_stations:
        near = separation <= settings.near_by_ranges_m
    return tuple(
        (b, a) if (b, a) in named else (a, b)
        for (i, a), (j, b) in combinations(enumerate(stations), 2)
        if near[i, j] or (a, b) in named or (b, a) in named
    )


def index_scans(
    prepared: Mapping[StationId, PreparedScan], settings: MatchingSettings
) -> dict[StationId, ScanIndex]:
    """Look-up structures of every scan that has enough points to be matched."""
    return {
        station: index_scan(scan, settings)
        for station, scan in prepared.items()
        if len(scan.points) >= 3
    }


def match_pairs(
    pairs: Sequence[Pair],
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    progress: Progress = silent,
    share: Share = alone,
) -> tuple[ScanMatch, ...]:
    """Hypotheses of all pairs, in the order of the pairs, each pair's best first."""
    match = partial(_match_part, share.keep(scans), settings)
    found = share(match, [pairs[part] for part in shared_parts(len(pairs))])
    matches: list[ScanMatch] = []
    for done, of_pair in enumerate(chain.from_iterable(found), start=1):
        matches.extend(of_pair)
        progress("matching scans", done, len(pairs))
    return tuple(matches)


def _match_part(
    scans: Kept[Mapping[StationId, ScanIndex]], settings: MatchingSettings, pairs: Sequence[Pair]
) -> list[tuple[ScanMatch, ...]]:
    return match_together(
        [(scans.value[target], scans.value[source]) for target, source in pairs], settings
    )
