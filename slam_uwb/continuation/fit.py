"""Whether an earlier solution still fits: what its matches rest on must not have changed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .._version import __version__
from ..model.errors import SlamUwbError
from ..model.products import LinkMeasurement
from ..model.settings import Settings
from ..model.solution import Solution
from ..model.survey import Decision, Scan, StationId, Survey

_SECTIONS = ("scan", "matching")
"""Settings that the matches depend on; those of later steps may differ, since these run again."""


def require_fit(
    earlier: Solution,
    survey: Survey,
    settings: Settings,
    scans: Mapping[StationId, Scan],
    links: Sequence[LinkMeasurement],
) -> None:
    """Refuse an earlier solution that the survey has outgrown.

    Args:
        earlier: of the same survey, before it had its new stations.
        survey: as it is now.
        settings: those to solve with.
        scans: of the survey, reduced.
        links: of the survey, reduced.

    Raises:
        SlamUwbError: names everything that has changed, one line each.
    """
    changes = [
        *_software_changes(earlier, settings),
        *_station_changes(earlier, survey, scans),
        *_link_changes(earlier, links),
        *_decision_changes(earlier, survey),
    ]
    if changes:
        raise SlamUwbError(
            "the earlier solution does not fit the survey any more; solve without --continue:\n"
            + "\n".join(f"  {change}" for change in changes)
        )


def _software_changes(earlier: Solution, settings: Settings) -> Iterator[str]:
    if earlier.software_version != __version__:
        yield f"it was solved by version {earlier.software_version}, this is {__version__}"
    before, now = earlier.settings.model_dump(), settings.model_dump()
    for section in _SECTIONS:
        for name, value in now[section].items():
            if value != before[section][name]:
                yield f"{section}.{name} is {value}, it was {before[section][name]}"


def _station_changes(
    earlier: Solution, survey: Survey, scans: Mapping[StationId, Scan]
) -> Iterator[str]:
    there = {station.id for station in survey.stations}
    for station in earlier.stations:
        before, now = earlier.scans.get(station.id), scans.get(station.id)
        if station.id not in there:
            yield f"station {station.id} is not in the survey"
        elif before is None or now is None:
            if before is not now:
                yield f"station {station.id} has {'lost its' if now is None else 'got a'} scan"
        elif not _same_scan(before, now):
            yield f"the scan of {station.id} has changed"


def _same_scan(a: Scan, b: Scan) -> bool:
    return (
        a.max_range == b.max_range
        and np.array_equal(a.bearings, b.bearings)
        and np.array_equal(a.ranges, b.ranges, equal_nan=True)
    )


def _link_changes(earlier: Solution, links: Sequence[LinkMeasurement]) -> Iterator[str]:
    """Ranges between stations and anchors that were there before; a new anchor may be new everywhere."""
    stations = {item.id for item in earlier.stations}
    anchors = {item.id for item in earlier.anchors}
    before = {(k.station, k.anchor): (k.samples, k.distance) for k in earlier.links}
    now = {
        (k.station, k.anchor): (k.samples, k.distance)
        for k in links
        if k.station in stations and k.anchor in anchors
    }
    if bool(before) != bool(now):
        yield f"it was solved with{'' if before else 'out'} ranges"
        return
    changed = [
        f"{station} to {anchor}"
        for station, anchor in sorted(before.keys() | now.keys())
        if not _same_range(before.get((station, anchor)), now.get((station, anchor)))
    ]
    if changed:
        yield f"ranges have changed: {', '.join(changed)}"


def _same_range(a: tuple[int, float] | None, b: tuple[int, float] | None) -> bool:
    if a is None or b is None:
        return False
    return a[0] == b[0] and (a[1] == b[1] or (math.isnan(a[1]) and math.isnan(b[1])))


def _decision_changes(earlier: Solution, survey: Survey) -> Iterator[str]:
    """Decisions about earlier pairs; links and new stations are judged again anyway."""
    stations = {str(item.id) for item in earlier.stations}

    def settled(decisions: Sequence[Decision]) -> set[Decision]:
        return {d for d in decisions if d.kind == "pair" and stations.issuperset((d.a, d.b))}

    before = settled([outcome.decision for outcome in earlier.decisions])
    for decision in sorted(before ^ settled(survey.decisions), key=lambda d: (d.a, d.b)):
        yield f"the decision about the pair {decision.a}, {decision.b} has changed"
