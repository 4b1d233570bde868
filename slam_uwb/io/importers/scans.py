"""Text formats of one scanner recording a file: each reads a file into bearings and ranges."""

from __future__ import annotations

import re

import numpy as np

from ...model.geometry import FloatArray
from ..degrees import radians_from_degrees
from ..files import FileContent
from ..findings import Findings
from ..tables import Column, Table, read_table
from .source import fault, lines, numbers, raise_faults

Polar = tuple[FloatArray, FloatArray]
"""(N,) rad counter-clockwise, (N,) m with NaN for no return."""
_NO_RETURN_M = 0.0101
"""A Sweep marks a missing return by one centimetre."""


def read_sweep_csv(content: FileContent, band: tuple[float, float]) -> Polar:
    """Sweep Visualizer export: header X,Y,Z[,SIGNAL_STRENGTH], centimetres; z outside `band` m is left out."""
    columns = [Column(name, finite=True) for name in ("X", "Y", "Z")]
    table = _table(content, [*columns, Column("SIGNAL_STRENGTH", required=False)])
    x, y, z = (table.numbers[name] / 100.0 for name in ("X", "Y", "Z"))
    inside = (z >= band[0]) & (z <= band[1])
    if not inside.any():
        raise fault(content, None, "Z", outside_band(len(z), band))
    return polar(np.column_stack([x, y])[inside])


def outside_band(number: int, band: tuple[float, float]) -> str:
    """What is wrong where none of so many points lies in the band, m."""
    return f"none of {number:,} points has z from {band[0]:g} to {band[1]:g} m (--band-m)"


def polar(points: FloatArray) -> Polar:
    """(N, 2) m about the scanner -> bearings and ranges."""
    ranges = np.hypot(points[:, 0], points[:, 1])
    bearings = np.arctan2(points[:, 1], points[:, 0])
    return bearings, np.where(ranges > _NO_RETURN_M, ranges, np.nan)


_FRAME = re.compile(r"(\S+)\s+(\S+)\s+(\S+)")


def read_frame_grabber(content: FileContent, _band: tuple[float, float]) -> Polar:
    """Slamtec frame_grabber text: `#` lines, then degrees (clockwise), mm, quality; 0 mm is no return."""
    rows = []
    for number, line in lines(content):
        if not line.strip() or line.startswith("#"):
            continue
        match = _FRAME.fullmatch(line.strip())
        if match is None:
            raise fault(content, number, None, f"{line[:40]!r}: expected angle, distance, quality")
        rows.append(
            numbers(content, number, list(match.groups()), ["Angule", "Distance", "Quality"])
        )
    if not rows:
        raise fault(content, None, None, "no samples")
    table = np.array(rows)
    millimetres = table[:, 1]
    return radians_from_degrees(-table[:, 0]), np.where(
        millimetres > 0, millimetres / 1000.0, np.nan
    )


_ANGLES = {"angle_deg": 1.0, "azimuth_deg": 1.0, "angle_rad": np.degrees(1.0), "angle_mdeg": 1e-3}
_RANGES = {"range_m": 1.0, "distance_m": 1.0, "distance_cm": 0.01, "distance_mm": 0.001}


def read_plain_csv(content: FileContent, _band: tuple[float, float]) -> Polar:
    """CSV with one angle column and one range column, the unit in their names; counter-clockwise."""
    header = content.data.partition(b"\n")[0].decode("utf-8", "replace").strip("\ufeff\r")
    names = [name.strip() for name in header.split(",")]
    angle = next((name for name in _ANGLES if name in names), None)
    distance = next((name for name in _RANGES if name in names), None)
    if angle is None or distance is None:
        raise fault(
            content,
            1,
            None,
            f"{header[:60]!r}: expected a column of {', '.join(_ANGLES)} and one of {', '.join(_RANGES)}",
        )
    table = _table(content, [Column(angle, finite=True), Column(distance, may_be_empty=True)])
    ranges = table.numbers[distance] * _RANGES[distance]
    return (
        radians_from_degrees(table.numbers[angle] * _ANGLES[angle]),
        np.where(ranges > 0.0, ranges, np.nan),
    )


def _table(content: FileContent, columns: list[Column]) -> Table:
    findings = Findings()
    table = read_table(content, columns, findings)
    raise_faults(findings)
    if table is None or not len(table.lines):
        raise fault(content, None, None, "no rows")
    return table
