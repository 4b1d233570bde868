"""What of an earlier solution's matches stands, and what is left to match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..model.products import ScanMatch
from ..model.solution import Solution
from ..model.survey import StationId

Pair = tuple[StationId, StationId]


@dataclass(frozen=True, slots=True)
class Earlier:
    """What of an earlier solution stands; empty where there is none."""

    hypotheses: tuple[ScanMatch, ...] = ()
    """All of them, without the reasons why they were not used."""
    used: tuple[ScanMatch, ...] = ()
    """Those that hold the earlier map together, the ones with most evidence first."""
    stations: frozenset[StationId] = frozenset()
    """Those whose scans were matched with each other."""

    def unmatched(self, pairs: Sequence[Pair]) -> tuple[Pair, ...]:
        """The pairs that were not matched yet: those of a new station."""
        return tuple(pair for pair in pairs if not self.stations.issuperset(pair))

    def open(self, pairs: Sequence[Pair]) -> tuple[Pair, ...]:
        """The pairs that are not settled: those of a station that the earlier map does not hold."""
        held = {station for match in self.used for station in match.ends}
        return tuple(pair for pair in pairs if not held.issuperset(pair))

    def firm(self, decided: Sequence[ScanMatch]) -> tuple[ScanMatch, ...]:
        """The matches that are used as they are: the earlier ones, then those decided since."""
        settled = {match.ends for match in self.used}
        return (*self.used, *(match for match in decided if match.ends not in settled))


def earlier_matches(earlier: Solution | None) -> Earlier:
    """The matches of an earlier solution, to be matched no more."""
    if earlier is None:
        return Earlier()
    used = [match for match in earlier.matches if match.rejection is None]
    return Earlier(
        hypotheses=tuple(replace(match, rejection=None) for match in earlier.matches),
        used=tuple(sorted(used, key=lambda match: -match.score)),
        stations=frozenset(earlier.scans),
    )
