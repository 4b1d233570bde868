"""A positioning recording: positioning.toml, epochs.csv, truth.csv <-> `TagRecording` and `TagTruth`.

docs/positioning.md describes the files.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..model.errors import Fault, SurveyFormatError
from ..model.geometry import Points
from ..model.survey import AnchorId
from ..model.tag import (
    Epoch,
    ReceivedPower,
    TagRecording,
    TagTruth,
    TimeDifference,
)
from .csv_text import Cell, number, table
from .files import FileContent, FolderReader
from .findings import Findings, shown
from .positioning_toml import POSITIONING_TOML, parse_positioning_toml, positioning_toml
from .tables import Column, Table, read_table

EPOCHS, TRUTH = "epochs.csv", "truth.csv"
SPEED_OF_LIGHT = 299_792_458.0
"""m/s."""
FURTHEST_M = 1000.0
"""A larger time difference is a fault of the device: kept, not used."""

_EPOCH_COLUMNS = (
    Column("time_s", finite=True),
    Column("kind", number=False),
    Column("anchor_a", number=False),
    Column("anchor_b", number=False, required=False),
    Column("value", may_be_empty=True),
)
_TRUTH_COLUMNS = (
    Column("place", number=False, required=False),
    Column("x_m", finite=True),
    Column("y_m", finite=True),
    Column("time_s", required=False, may_be_empty=True),
)


@dataclass(frozen=True, slots=True)
class TagCheck:
    """What a look at a positioning recording found."""

    recording: TagRecording | None
    """None where there is any fault."""
    truth: TagTruth | None
    """None where there is any fault, or no truth.csv."""
    faults: tuple[Fault, ...]
    warnings: tuple[Fault, ...]


def read_tag_recording(folder: Path) -> tuple[TagRecording, TagTruth | None]:
    """Read a recording and, where it is there, its truth; SurveyFormatError holds every fault found."""
    check = check_tag_recording(folder)
    if check.recording is None:
        raise SurveyFormatError(check.faults)
    return check.recording, check.truth


def check_tag_recording(folder: Path) -> TagCheck:
    """Look at everything in the folder; never raises for what is in it."""
    findings = Findings()
    recording = truth = None
    if not folder.is_dir():
        findings.fault(str(folder), "is no folder" if folder.exists() else "no such folder")
    else:
        reader = FolderReader(folder.resolve(), findings)
        recording = _recording(reader, findings)
        truth = _truth(reader, recording, findings)
    faults = findings.faults
    if faults:
        return TagCheck(None, None, faults, findings.warnings)
    return TagCheck(recording, truth, (), findings.warnings)


def tag_recording_files(recording: TagRecording, truth: TagTruth | None = None) -> dict[str, bytes]:
    """The files of a recording, name -> content; what is read back is equal to the microsecond and 0.3 um."""
    files = {
        POSITIONING_TOML: positioning_toml(recording),
        EPOCHS: table(("time_s", "kind", "anchor_a", "anchor_b", "value"), _rows(recording)),
    }
    if truth is not None:
        files[TRUTH] = _truth_table(truth)
    return files


def _recording(reader: FolderReader, findings: Findings) -> TagRecording | None:
    content = reader.read(POSITIONING_TOML, 1_000_000)
    head = None if content is None else parse_positioning_toml(content, findings)
    rows = reader.read(EPOCHS)
    epochs = () if rows is None else _epochs(rows, findings)
    if head is None:
        return None
    if head.power_law is None and any(epoch.powers for epoch in epochs):
        findings.fault(POSITIONING_TOML, "[power]: required, but missing: epochs.csv has rss_dbm")
    for stay in head.stays:
        if not any(stay.start <= epoch.time < stay.end for epoch in epochs):
            findings.warn(POSITIONING_TOML, f"place {stay.id}: no epoch between its times")
    name = head.name or reader.root.name
    return TagRecording(
        name, head.tag_height, epochs, head.stays, head.power_law, head.anchor_heights
    )


def _epochs(content: FileContent, findings: Findings) -> tuple[Epoch, ...]:
    rows = read_table(content, _EPOCH_COLUMNS, findings)
    if rows is None or not rows.sound:
        return ()
    found: dict[float, tuple[list[TimeDifference], list[ReceivedPower]]] = {}
    absurd = 0
    others = rows.texts.get("anchor_b", ("",) * len(rows.lines))
    cells = zip(
        rows.lines.tolist(),
        rows.numbers["time_s"].tolist(),
        rows.texts["kind"],
        rows.texts["anchor_a"],
        others,
        rows.numbers["value"].tolist(),
        strict=True,
    )
    for line, time, kind, a, b, value in cells:
        differences, powers = found.setdefault(time, ([], []))
        problem = _problem(kind, a, b)
        if problem is not None:
            findings.fault(rows.name, problem[1], line, problem[0])
        elif kind == "rss_dbm":
            powers.append(ReceivedPower(AnchorId(a), value))
        else:
            metres = value * SPEED_OF_LIGHT
            absurd += abs(metres) > FURTHEST_M
            metres = metres if abs(metres) <= FURTHEST_M else math.nan
            differences.append(TimeDifference(AnchorId(a), AnchorId(b), metres))
    if absurd:
        findings.warn(
            rows.name, f"{absurd} time differences of more than {FURTHEST_M:g} m are not used"
        )
    if not found and not findings.faults:
        findings.fault(rows.name, "no row: expected measurements")
    return tuple(
        Epoch(time, tuple(differences), tuple(powers))
        for time, (differences, powers) in sorted(found.items())
    )


def _problem(kind: str, a: str, b: str) -> tuple[str, str] | None:
    """Column and what is wrong in it."""
    if kind not in ("tdoa_s", "rss_dbm"):
        return "kind", f"{shown(kind)}: expected tdoa_s or rss_dbm"
    if not a:
        return "anchor_a", "empty: expected an anchor"
    if kind == "tdoa_s" and (not b or b == a):
        return "anchor_b", f"{shown(b)}: a time difference needs another anchor than anchor_a"
    if kind == "rss_dbm" and b:
        return "anchor_b", f"{shown(b)}: expected nothing, a power is of one anchor"
    return None


def _truth(
    reader: FolderReader, recording: TagRecording | None, findings: Findings
) -> TagTruth | None:
    content = reader.read_optional(TRUTH)
    rows = None if content is None else read_table(content, _TRUTH_COLUMNS, findings)
    if rows is None or not rows.sound:
        return None
    points = np.column_stack([rows.numbers["x_m"], rows.numbers["y_m"]])
    if "place" in rows.texts:
        return _static_truth(rows, points, recording, findings)
    if recording is not None and recording.stays:
        findings.fault(
            rows.name, "column place is missing: positioning.toml has [[places]]", 1, "place"
        )
    if len(points) < 2:
        findings.fault(rows.name, f"{len(points)} rows: expected the corners of a path")
    return TagTruth({}, points)


def _static_truth(
    rows: Table, points: Points, recording: TagRecording | None, findings: Findings
) -> TagTruth:
    known = {stay.id for stay in recording.stays} if recording is not None else set()
    places = {}
    for line, name, point in zip(rows.lines.tolist(), rows.texts["place"], points, strict=True):
        if name in places:
            findings.fault(rows.name, f"{shown(name)} is there twice", line, "place")
        elif recording is not None and name not in known:
            findings.fault(
                rows.name, f"{shown(name)}: positioning.toml has no such place", line, "place"
            )
        places[name] = point
    return TagTruth(places)


def _rows(recording: TagRecording) -> Iterable[list[Cell]]:
    for epoch in recording.epochs:
        time = number(epoch.time, 6)
        for item in epoch.differences:
            # 1e-15 s is 0.3 um.
            seconds = number(item.difference / SPEED_OF_LIGHT, 15)
            yield [time, "tdoa_s", item.anchor_a, item.anchor_b, seconds]
        for power in epoch.powers:
            yield [time, "rss_dbm", power.anchor, "", number(power.power, 2)]


def _truth_table(truth: TagTruth) -> bytes:
    if truth.path is None:
        rows = ([name, number(x, 4), number(y, 4)] for name, (x, y) in truth.places.items())
        return table(("place", "x_m", "y_m"), rows)
    return table(("x_m", "y_m"), ([number(x, 4), number(y, 4)] for x, y in truth.path.tolist()))
