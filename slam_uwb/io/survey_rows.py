"""The CSV files of a survey folder -> values of `model.survey`, with every wrong row named."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.survey import (
    AnchorId,
    AnchorRangeSamples,
    RangeSamples,
    Scan,
    StationId,
    TwoWayPeriods,
)
from .degrees import radians_from_degrees
from .files import FileContent
from .findings import Findings, shown
from .tables import Column, Table, read_table

ABSURD_RANGE_M = 1000.0
"""No UWB radio reaches so far."""

_TIME = Column("time_s", required=False, may_be_empty=True)
SCAN = (
    Column("angle_deg", finite=True),
    Column("range_m", may_be_empty=True),
    _TIME,
    Column("signal", required=False, may_be_empty=True),
)
# What a device says of quality and line of sight is its own: any text, not used.
RANGES = (
    Column("station", number=False),
    Column("anchor", number=False),
    Column("range_m", may_be_empty=True),
    _TIME,
    Column("rss_dbm", required=False, may_be_empty=True),
    Column("quality", number=False, required=False),
    Column("nlos", number=False, required=False),
)
PERIODS = ("t1_s", "t2_s", "t3_s", "t4_s")
TWR = (
    Column("station", number=False),
    Column("anchor", number=False),
    *map(Column, PERIODS),
    _TIME,
)
ANCHOR_RANGES = (
    Column("anchor_a", number=False),
    Column("anchor_b", number=False),
    Column("range_m", may_be_empty=True),
    _TIME,
)


@dataclass(frozen=True, slots=True)
class Names:
    """What the rows may speak of; `anchors` maps identifiers and radio identifiers to identifiers."""

    stations: Mapping[str, StationId]
    anchors: Mapping[str, AnchorId]


def read_scan(
    contents: Sequence[FileContent], angle_direction: str, max_range: float, findings: Findings
) -> Scan | None:
    """One set-up from its recordings, one after the other; None where a fault was noted."""
    parts = [_read_recording(content, angle_direction, max_range, findings) for content in contents]
    sound = [part for part in parts if part is not None]
    if not sound or len(sound) < len(parts):
        return None
    return Scan(
        bearings=np.concatenate([bearings for bearings, _ in sound]),
        ranges=np.concatenate([ranges for _, ranges in sound]),
        max_range=max_range,
    )


def _read_recording(
    content: FileContent, angle_direction: str, max_range: float, findings: Findings
) -> tuple[FloatArray, FloatArray] | None:
    table = read_table(content, SCAN, findings)
    if table is None or not table.sound:
        return None
    ranges = table.numbers["range_m"]
    negative = np.flatnonzero(ranges < 0.0)
    for row in negative:
        findings.fault(
            content.name,
            f"{ranges[row]:g}: expected a distance; 0, empty or nan is no return",
            int(table.lines[row]),
            "range_m",
        )
    ranges = np.where((ranges > 0.0) & (ranges <= max_range), ranges, np.nan)
    if np.isnan(ranges).all() and not len(negative):
        findings.fault(
            content.name,
            f"no return at all in {len(ranges)} rows: every range is 0, empty, nan or over {max_range:g} m",
        )
        return None
    degrees = table.numbers["angle_deg"]
    if len(degrees) >= 20 and np.ptp(degrees) <= 2.0 * np.pi:
        findings.warn(
            content.name, f"the angles span {np.ptp(degrees):.2f} degrees in all: are they radians?"
        )
    sign = 1.0 if angle_direction == "ccw" else -1.0
    return (radians_from_degrees(sign * degrees), ranges) if not len(negative) else None


def read_ranges(content: FileContent, names: Names, findings: Findings) -> tuple[RangeSamples, ...]:
    """ranges.csv by link, in the order of the links' first rows."""
    table = read_table(content, RANGES, findings)
    if table is None:
        return ()
    _warn_of_absurd_ranges(table, findings)
    return tuple(
        RangeSamples(station, anchor, table.numbers["range_m"][rows])
        for station, anchor, rows in _links(table, names, findings)
    )


def read_periods(
    content: FileContent, names: Names, findings: Findings
) -> tuple[TwoWayPeriods, ...]:
    """twr.csv by link, in the order of the links' first rows; (K, 4) periods as they are."""
    table = read_table(content, TWR, findings)
    if table is None:
        return ()
    periods = np.column_stack([table.numbers[name] for name in PERIODS])
    if table.sound:
        for row, column in np.argwhere(~(np.isfinite(periods) & (periods > 0.0))):
            findings.warn(
                table.name,
                f"{periods[row, column]:g}: expected a positive period; kept, not used",
                int(table.lines[row]),
                PERIODS[column],
            )
    return tuple(
        TwoWayPeriods(station, anchor, periods[rows])
        for station, anchor, rows in _links(table, names, findings)
    )


def read_anchor_ranges(
    content: FileContent, names: Names, findings: Findings
) -> tuple[AnchorRangeSamples, ...]:
    """anchor_ranges.csv by pair of anchors, whichever of the two measured."""
    table = read_table(content, ANCHOR_RANGES, findings)
    if table is None:
        return ()
    _warn_of_absurd_ranges(table, findings)
    first = _heard(table, "anchor_a", names, findings)
    second = _heard(table, "anchor_b", names, findings)
    keys: list[tuple[AnchorId, AnchorId] | None] = []
    seen: dict[frozenset[AnchorId], tuple[AnchorId, AnchorId]] = {}
    for a, b, line in zip(first, second, table.lines, strict=True):
        if a is None or b is None:
            keys.append(None)
            continue
        if a == b:
            problem = f"{shown(a)}: an anchor has no distance to itself"
            findings.fault(table.name, problem, int(line), "anchor_b")
        keys.append(seen.setdefault(frozenset((a, b)), (a, b)))
    return tuple(
        AnchorRangeSamples(a, b, table.numbers["range_m"][rows]) for (a, b), rows in _groups(keys)
    )


def _warn_of_absurd_ranges(table: Table, findings: Findings) -> None:
    if not table.sound:
        return
    ranges = table.numbers["range_m"]
    for row in np.flatnonzero(~((ranges >= 0.0) & (ranges <= ABSURD_RANGE_M))):
        findings.warn(
            table.name,
            f"{ranges[row]:g}: expected 0 to {ABSURD_RANGE_M:g} m; kept, not used",
            int(table.lines[row]),
            "range_m",
        )


def _links(
    table: Table, names: Names, findings: Findings
) -> Iterator[tuple[StationId, AnchorId, NDArray[np.int64]]]:
    """Station, anchor and rows of each link in the order of first rows; unlisted anchors left out."""
    stations = table.texts["station"]
    for station, rows in _unlisted(stations, names.stations).items():
        findings.fault(
            table.name,
            f"{shown(station)}: no such station in survey.toml ({len(rows)} rows, this is the first)",
            int(table.lines[rows[0]]),
            "station",
        )
    anchors = _heard(table, "anchor", names, findings)
    keys = [
        (names.stations[s], a) if a is not None and s in names.stations else None
        for s, a in zip(stations, anchors, strict=True)
    ]
    for (station, anchor), places in _groups(keys):
        yield station, anchor, places


def _heard(table: Table, column: str, names: Names, findings: Findings) -> list[AnchorId | None]:
    """Anchor of each row, None where survey.toml does not list it: a neighbour's radio is no fault."""
    for anchor, rows in _unlisted(table.texts[column], names.anchors).items():
        findings.warn(
            table.name,
            f"{shown(anchor)} is heard but not listed in survey.toml: its {len(rows)} rows are ignored",
            int(table.lines[rows[0]]),
            column,
        )
    return [names.anchors.get(anchor) for anchor in table.texts[column]]


def _unlisted(cells: Sequence[str], listed: Mapping[str, str]) -> dict[str, list[int]]:
    rows: dict[str, list[int]] = {}
    for row, cell in enumerate(cells):
        if cell not in listed:
            rows.setdefault(cell, []).append(row)
    return rows


_Key = TypeVar("_Key")


def _groups(keys: Sequence[_Key | None]) -> Iterator[tuple[_Key, NDArray[np.int64]]]:
    """Rows of each key in the order of first rows."""
    groups: dict[_Key, list[int]] = {}
    for row, key in enumerate(keys):
        if key is not None:
            groups.setdefault(key, []).append(row)
    for key, rows in groups.items():
        yield key, np.array(rows, dtype=np.int64)
