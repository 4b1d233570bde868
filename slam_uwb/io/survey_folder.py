"""A survey folder, format 1 -> `Survey`, with every fault and warning of the folder at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..model.errors import Fault, SurveyFormatError
from ..model.survey import (
    Anchor,
    AnchorId,
    KnownPlace,
    RangeOffset,
    Scan,
    Station,
    StationId,
    Survey,
)
from .decisions import read_decisions
from .degrees import radians_from_degrees
from .files import MAX_TOML_BYTES, FileContent, FolderReader
from .findings import Findings, shown
from .survey_checks import fault_of_layout, warn_of_doubts
from .survey_rows import Names, read_anchor_ranges, read_periods, read_ranges, read_scan
from .survey_toml import SURVEY_TOML, AnchorTable, StationTable, SurveyToml, parse_survey_toml


@dataclass(frozen=True, slots=True, eq=False)
class SurveyCheck:
    """What a look at a survey folder found."""

    survey: Survey | None
    """None where there is any fault."""
    faults: tuple[Fault, ...]
    warnings: tuple[Fault, ...]


def read_survey(folder: Path) -> Survey:
    """Read a survey folder, format 1; SurveyFormatError holds every fault found, not only the first.

    Bearings become counter-clockwise radians in (-pi, pi] whatever the scanner's direction; what is no
    return or beyond `max_range_m` is NaN; two-way-ranging periods stay periods.
    """
    check = check_survey(folder)
    if check.survey is None:
        raise SurveyFormatError(check.faults)
    return check.survey


def check_survey(folder: Path) -> SurveyCheck:
    """Look at everything in a survey folder; never raises for what is in it."""
    findings = Findings()
    survey = _read(folder, findings)
    faults = findings.faults
    return SurveyCheck(None if faults else survey, faults, findings.warnings)


def _read(folder: Path, findings: Findings) -> Survey | None:
    try:
        if not folder.is_dir():
            findings.fault(str(folder), "is no folder" if folder.exists() else "no such folder")
            return None
    except OSError as error:
        findings.fault(str(folder), f"cannot be read: {error.strerror}")
        return None
    reader = FolderReader(folder.resolve(), findings)
    content = reader.read(SURVEY_TOML, MAX_TOML_BYTES)
    toml = None if content is None else parse_survey_toml(content, findings)
    if toml is None:
        return None
    survey = _survey(toml, reader, folder.resolve().name)
    fault_of_layout(survey, toml, has_ranges=_was_read(reader, "ranges.csv", "twr.csv"))
    warn_of_doubts(survey, toml)
    # Last: by now everything that the survey uses was read.
    return replace(survey, checksum=reader.checksum())


def _survey(toml: SurveyToml, reader: FolderReader, folder_name: str) -> Survey:
    names = _names(toml)
    ranges = _rows("ranges.csv", read_ranges, names, reader)
    periods = _rows("twr.csv", read_periods, names, reader)
    # The exchange says more than the device's own distance: where both exist it is taken.
    exchanged = {(link.station, link.anchor) for link in periods}
    tag = toml.tag
    return Survey(
        name=_name(toml, folder_name),
        stations=tuple(_station(index, table, toml, reader) for index, table in toml.stations),
        anchors=tuple(_anchor(table) for _, table in toml.anchors),
        ranges=tuple(link for link in ranges if (link.station, link.anchor) not in exchanged),
        periods=periods,
        anchor_ranges=_rows("anchor_ranges.csv", read_anchor_ranges, names, reader),
        sequence=_sequence(toml, names),
        tag_offset=(0.0, 0.0) if tag is None else (tag.offset_x_m, tag.offset_y_m),
        range_offset=_range_offset(toml),
        decisions=_rows("decisions.csv", read_decisions, names, reader),
    )


_Read = TypeVar("_Read")


def _rows(
    name: str,
    read: Callable[[FileContent, Names, Findings], tuple[_Read, ...]],
    names: Names,
    reader: FolderReader,
) -> tuple[_Read, ...]:
    content = reader.read_optional(name)
    return () if content is None else read(content, names, reader.findings)


def _was_read(reader: FolderReader, *names: str) -> bool:
    return not reader.digests.keys().isdisjoint([*names, *(f"{name}.gz" for name in names)])


def _name(toml: SurveyToml, folder_name: str) -> str:
    if toml.top.name is None:
        toml.warn(("name",), f" is missing: the folder's, {shown(folder_name)}, is taken")
    return toml.top.name or folder_name


def _names(toml: SurveyToml) -> Names:
    stations: dict[str, StationId] = {}
    for index, station in toml.stations:
        if station.id in stations:
            toml.fault(
                ("stations", index, "id"), f" = {shown(station.id)}: this station is there twice"
            )
        stations[station.id] = StationId(station.id)
    anchors: dict[str, AnchorId] = {}
    for index, anchor in toml.anchors:
        if anchor.id in anchors:
            toml.fault(
                ("anchors", index, "id"), f" = {shown(anchor.id)}: this anchor is there twice"
            )
        anchors[anchor.id] = AnchorId(anchor.id)
    for index, anchor in toml.anchors:
        # A radio that is another anchor's identifier would leave a row of ranges.csv with two meanings.
        if (
            anchor.radio is not None
            and anchors.setdefault(anchor.radio, AnchorId(anchor.id)) != anchor.id
        ):
            other = anchors[anchor.radio]
            toml.fault(
                ("anchors", index, "radio"),
                f" = {shown(anchor.radio)}: anchor {other} has this identifier",
            )
    return Names(stations, anchors)


def _station(index: int, table: StationTable, toml: SurveyToml, reader: FolderReader) -> Station:
    tag_height = table.tag_height_m
    if tag_height is None:
        tag_height = (
            float("nan") if toml.tag is None or toml.tag.height_m is None else toml.tag.height_m
        )
    if not table.complete:
        toml.warn(
            ("stations", index, "complete"),
            " = false: the recording broke off; it is used as it is",
        )
    return Station(
        id=StationId(table.id),
        scan=_scan(table.scan, toml, reader),
        tag_height=tag_height,
        known=_known(table),
        upper_scan=_scan(table.upper_scan, toml, reader),
        upper_scan_height=table.upper_scan_height_m,
        complete=table.complete,
    )


def _scan(files: Iterable[str] | None, toml: SurveyToml, reader: FolderReader) -> Scan | None:
    if files is None:
        return None
    contents = [content for content in map(reader.read, files) if content is not None]
    direction = "ccw" if toml.lidar is None else toml.lidar.angle_direction
    max_range = 40.0 if toml.lidar is None else toml.lidar.max_range_m
    return read_scan(contents, direction, max_range, reader.findings)


def _known(table: StationTable) -> KnownPlace | None:
    if table.x_m is None or table.y_m is None:
        return None
    return KnownPlace(
        x=table.x_m,
        y=table.y_m,
        sigma=table.sigma_m,
        theta=None if table.yaw_deg is None else float(radians_from_degrees(table.yaw_deg)),
        sigma_theta=float(np.deg2rad(table.sigma_yaw_deg)),
    )


def _anchor(table: AnchorTable) -> Anchor:
    known = (
        None
        if table.x_m is None or table.y_m is None
        else KnownPlace(table.x_m, table.y_m, table.sigma_m)
    )
    return Anchor(AnchorId(table.id), table.height_m, known)


def _sequence(toml: SurveyToml, names: Names) -> tuple[tuple[StationId, StationId], ...] | None:
    if toml.top.sequence is None:
        return None
    for index, pair in enumerate(toml.top.sequence):
        for place, station in enumerate(pair):
            if station not in names.stations:
                toml.fault(("sequence", index, place), f" = {shown(station)}: no such station")
        if pair[0] == pair[1]:
            toml.fault(("sequence", index), f" = {shown(pair)}: expected two different stations")
    return tuple((StationId(m), StationId(n)) for m, n in toml.top.sequence)


def _range_offset(toml: SurveyToml) -> RangeOffset | None:
    if toml.tag is None or toml.tag.range_offset_m is None:
        return None
    return RangeOffset(toml.tag.range_offset_m, toml.tag.range_offset_sigma_m)
