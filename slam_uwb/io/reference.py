"""The reference of a survey: ground truth, used by evaluation only."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import numpy as np

from ..model.errors import SurveyFormatError
from ..model.survey import AnchorId, Reference, ReferencePlace, StationId
from .degrees import radians_from_degrees
from .files import FolderReader
from .findings import Findings, shown
from .tables import Column, read_table

_PLACE = (Column("x_m", may_be_empty=True), Column("y_m", may_be_empty=True))
ANCHORS = (Column("anchor", number=False), *_PLACE)
STATIONS = (
    Column("station", number=False),
    *_PLACE,
    Column("yaw_deg", required=False, may_be_empty=True),
)

_Id = TypeVar("_Id", AnchorId, StationId)


def read_reference(folder: Path) -> Reference:
    """Read anchors.csv and stations.csv of a survey's `reference` folder, or of that folder itself.

    Either file may be missing (but not both); an empty cell is NaN; yaw becomes radians in
    (-pi, pi]. Further files and columns are left alone.

    Raises:
        SurveyFormatError: with every fault found.
    """
    findings = Findings()
    inside = folder / "reference"
    root = inside if inside.is_dir() else folder
    reader = FolderReader(root.resolve(), findings)
    anchors: dict[AnchorId, ReferencePlace] = {}
    stations: dict[StationId, ReferencePlace] = {}
    if not root.is_dir():
        findings.fault(str(root), "no such folder")
    else:
        anchors = _read(reader, "anchors.csv", ANCHORS, AnchorId)
        stations = _read(reader, "stations.csv", STATIONS, StationId)
        if not reader.digests and not findings.faults:
            findings.fault(str(root), "neither anchors.csv nor stations.csv: expected a reference")
    if findings.faults:
        raise SurveyFormatError(findings.faults)
    return Reference(stations, anchors)


def _read(
    reader: FolderReader, name: str, columns: tuple[Column, ...], identifier: type[_Id]
) -> dict[_Id, ReferencePlace]:
    content = reader.read_optional(name)
    table = None if content is None else read_table(content, columns, reader.findings)
    if table is None:
        return {}
    places: dict[_Id, ReferencePlace] = {}
    yaws = table.numbers.get("yaw_deg", np.full(len(table.lines), np.nan))
    names = table.texts[columns[0].name]
    rows = np.column_stack([table.numbers["x_m"], table.numbers["y_m"], radians_from_degrees(yaws)])
    for text, (x, y, theta), line in zip(names, rows.tolist(), table.lines.tolist(), strict=True):
        if not text or text in places:
            problem = f"{shown(text)} is there twice" if text else "empty: expected an identifier"
            reader.findings.fault(table.name, problem, line, columns[0].name)
        if np.isinf((x, y)).any():
            reader.findings.fault(table.name, "inf: expected a finite number or nothing", line)
        places[identifier(text)] = ReferencePlace(x, y, theta)
    return places
