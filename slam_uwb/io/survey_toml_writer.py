"""`Survey` -> the text of survey.toml."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import tomlkit

from ..model.survey import Anchor, KnownPlace, Scan, Station, Survey
from .degrees import degrees_from_radians


def recordings(station: Station) -> Iterator[tuple[str, str, Scan]]:
    """Key of survey.toml, name without suffix, and scan of each recording of a station."""
    if station.scan is not None:
        yield "scan", f"scans/{station.id}", station.scan
    if station.upper_scan is not None:
        # In a folder of its own: a station may be called s01-upper.
        yield "upper_scan", f"scans/upper/{station.id}", station.upper_scan


def survey_toml(survey: Survey, suffix: str, angle_direction: str, lidar_model: str) -> str:
    """The text of survey.toml for recordings named by `recordings`, with `suffix` behind .csv."""
    document = tomlkit.document()
    document["format"] = 1
    document["name"] = survey.name
    if survey.sequence is not None:
        document["sequence"] = [list(pair) for pair in survey.sequence]
    ranges = {scan.max_range for station in survey.stations for *_, scan in recordings(station)}
    if len(ranges) > 1:
        raise ValueError(f"scans of max_range {sorted(ranges)} m: one survey has one scanner")
    if ranges:
        document["lidar"] = {
            "model": lidar_model,
            "angle_direction": angle_direction,
            "max_range_m": float(ranges.pop()),
        }
    tag = _tag(survey)
    if tag:
        document["tag"] = tag
    height = tag.get("height_m")
    document["stations"] = _tables(_station(item, suffix, height) for item in survey.stations)
    if survey.anchors:
        document["anchors"] = _tables(map(_anchor, survey.anchors))
    return tomlkit.dumps(document)


def _tables(rows: Iterable[dict[str, Any]]) -> tomlkit.items.AoT:
    tables = tomlkit.aot()
    for row in rows:
        table = tomlkit.table()
        table.update(row)
        tables.append(table)
    return tables


def _tag(survey: Survey) -> dict[str, Any]:
    heights = [station.tag_height for station in survey.stations]
    known = [height for height in heights if not math.isnan(height)]
    if known and len(known) < len(heights):
        raise ValueError("tag_height is NaN at some stations only")
    tag: dict[str, Any] = {"height_m": float(known[0])} if known else {}
    if any(survey.tag_offset):
        tag |= dict(zip(("offset_x_m", "offset_y_m"), map(float, survey.tag_offset), strict=True))
    if survey.range_offset is not None:
        tag["range_offset_m"] = float(survey.range_offset.mean)
        tag["range_offset_sigma_m"] = float(survey.range_offset.sigma)
    return tag


def _station(station: Station, suffix: str, tag_height: float | None) -> dict[str, Any]:
    row: dict[str, Any] = {"id": str(station.id)}
    for key, name, _ in recordings(station):
        row[key] = f"{name}.csv{suffix}"
    if station.upper_scan_height is not None:
        row["upper_scan_height_m"] = float(station.upper_scan_height)
    if tag_height is not None and station.tag_height != tag_height:
        row["tag_height_m"] = float(station.tag_height)
    row |= _known(station.known)
    if not station.complete:
        row["complete"] = False
    return row


def _anchor(anchor: Anchor) -> dict[str, Any]:
    height = {} if anchor.height is None else {"height_m": float(anchor.height)}
    return {"id": str(anchor.id)} | height | _known(anchor.known)


def _known(place: KnownPlace | None) -> dict[str, float]:
    if place is None:
        return {}
    known = {"x_m": float(place.x), "y_m": float(place.y), "sigma_m": float(place.sigma)}
    if place.theta is not None:
        known["yaw_deg"] = float(degrees_from_radians(place.theta))
        known["sigma_yaw_deg"] = float(degrees_from_radians(place.sigma_theta))
    return known
