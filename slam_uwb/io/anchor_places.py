"""Places of anchors to locate a tag with: anchors.csv of a solution, of a reference, or of one's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ..model.errors import SurveyFormatError
from ..model.geometry import FloatArray
from ..model.survey import AnchorId
from .files import FolderReader
from .findings import Findings, shown
from .tables import Column, Table, read_table

ANCHORS = "anchors.csv"
_COLUMNS = (
    Column("anchor", number=False),
    Column("x_m", may_be_empty=True),
    Column("y_m", may_be_empty=True),
    Column("z_m", required=False, may_be_empty=True),
    Column("status", number=False, required=False),
    *(
        Column(name, required=False, may_be_empty=True)
        for name in ("sigma_x_m", "sigma_y_m", "cov_xy_m2", "stations")
    ),
)


def read_anchor_places(
    path: Path, heights: Mapping[AnchorId, float]
) -> tuple[dict[AnchorId, FloatArray], tuple[str, ...]]:
    """(3,) m by anchor of those with a place that is to be trusted, and why the others are left out.

    Args:
        path: A table `anchor,x_m,y_m` with optional `z_m` and `status`, or a folder that holds an
            anchors.csv. Only anchors whose status is `ok` count, where there is a status.
        heights: m above the floor of those whose `z_m` the table does not give.

    Raises:
        SurveyFormatError: with every fault found.
    """
    findings = Findings()
    file = path / ANCHORS if path.is_dir() else path
    content = FolderReader(file.resolve().parent, findings).read(file.name)
    rows = None if content is None else read_table(content, _COLUMNS, findings)
    if rows is not None and rows.sound:
        _note_repeated(rows, findings)
    if rows is None or findings.faults:
        raise SurveyFormatError(findings.faults)
    found: dict[AnchorId, FloatArray] = {}
    left_out: list[str] = []
    for name, status, place in _places(rows, heights):
        if status != "ok":
            left_out.append(f"{name}: {status}")
        elif not np.isfinite(place).all():
            missing = "height" if np.isfinite(place[:2]).all() else "place"
            left_out.append(f"{name}: no {missing}")
        else:
            found[name] = place
    return found, tuple(left_out)


def _note_repeated(rows: Table, findings: Findings) -> None:
    seen: set[str] = set()
    for line, name in zip(rows.lines.tolist(), rows.texts["anchor"], strict=True):
        if name in seen:
            findings.fault(rows.name, f"{shown(name)} is there twice", line, "anchor")
        seen.add(name)


def _places(
    rows: Table, heights: Mapping[AnchorId, float]
) -> Iterator[tuple[AnchorId, str, FloatArray]]:
    """Name, status and (3,) m of each row, NaN where nobody tells."""
    count = len(rows.lines)
    status = rows.texts.get("status", ("ok",) * count)
    z = rows.numbers.get("z_m", np.full(count, np.nan))
    places = np.column_stack([rows.numbers["x_m"], rows.numbers["y_m"], z])
    for text, state, place in zip(rows.texts["anchor"], status, places, strict=True):
        name = AnchorId(text)
        if np.isnan(place[2]):
            place[2] = heights.get(name, np.nan)
        yield name, state, place
