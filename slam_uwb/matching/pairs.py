"""Which pairs are tried, and matching all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations
from multiprocessing import get_context

import numpy as np

from ..model.errors import SettingsError
from ..model.geometry import FloatArray
from ..model.products import PreparedScan, Progress, ScanMatch, silent
from ..model.settings import MatchingSettings
from ..model.survey import StationId
from .hypotheses import match_together
from .index import ScanIndex, index_scan
from .lanes import in_parts

Pair = tuple[StationId, StationId]
"""(m, n): target and source; fit scan n to scan m."""

_WORTH_PROCESSES = 400  # pairs; below, starting processes costs more than it saves


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
    workers: int = 1,
) -> tuple[ScanMatch, ...]:
    """Hypotheses of all pairs, in the order of the pairs, each pair's best first."""
    matches: list[ScanMatch] = []
    for done, found in enumerate(_matched(pairs, scans, settings, workers), start=1):
        matches.extend(found)
        progress("matching scans", done, len(pairs))
    return tuple(matches)


def _matched(
    pairs: Sequence[Pair],
    scans: Mapping[StationId, ScanIndex],
    settings: MatchingSettings,
    workers: int,
) -> Iterator[tuple[ScanMatch, ...]]:
    parts = [pairs[part] for part in in_parts(len(pairs))]
    if workers == 1 or len(pairs) < _WORTH_PROCESSES:
        for part in parts:
            yield from _match_part(part, scans, settings)
        return
    context = get_context("forkserver" if "forkserver" in _start_methods() else "spawn")
    with ProcessPoolExecutor(workers, context, _keep_in_process, (dict(scans), settings)) as pool:
        for found in pool.map(_match_in_process, parts):
            yield from found


def _match_part(
    pairs: Sequence[Pair], scans: Mapping[StationId, ScanIndex], settings: MatchingSettings
) -> list[tuple[ScanMatch, ...]]:
    return match_together([(scans[target], scans[source]) for target, source in pairs], settings)


def _start_methods() -> list[str]:
    from multiprocessing import get_all_start_methods

    return get_all_start_methods()


_in_process: tuple[Mapping[StationId, ScanIndex], MatchingSettings]
"""Set once in each worker process, so that scans travel once and not with every pair."""


def _keep_in_process(scans: Mapping[StationId, ScanIndex], settings: MatchingSettings) -> None:
    global _in_process  # noqa: PLW0603 - the only way a pool's initialiser can hand over
    _in_process = (scans, settings)


def _match_in_process(pairs: Sequence[Pair]) -> list[tuple[ScanMatch, ...]]:
    return _match_part(pairs, *_in_process)
