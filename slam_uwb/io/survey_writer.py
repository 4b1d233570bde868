"""`Survey` -> a survey folder, format 1, that reads back as the same survey."""

from __future__ import annotations

import gzip
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

from ..model.geometry import FloatArray
from ..model.survey import Decision, Reference, ReferencePlace, Scan, Survey
from . import csv_text
from .degrees import degrees_from_radians
from .folder_swap import refuse_foreign, replace_folder
from .survey_rows import PERIODS
from .survey_toml import SURVEY_TOML
from .survey_toml_writer import recordings, survey_toml

_TRUTH_DECIMALS = 6
"""The truth must not be what limits a comparison."""


def write_survey(
    survey: Survey,
    folder: Path,
    *,
    reference: Reference | None = None,
    link_truth: Mapping[tuple[str, str], tuple[int, float]] | None = None,
    compress: bool = True,
    angle_direction: Literal["ccw", "cw"] = "ccw",
    lidar_model: str = "scanse-sweep",
    decimals: int | None = 3,
) -> None:
    """Write a survey folder; the same survey gives the same bytes wherever and whenever.

    Args:
        survey: what to write. Its checksum is not written: it follows from the files.
        folder: new, empty, or a survey folder, which is replaced once the new one is complete.
        reference: the truth, for ``reference/``.
        link_truth: walls crossed and error in m put on the range, of (station, anchor), for
            ``reference/links.csv``.
        compress: recordings as ``.csv.gz``.
        angle_direction: how the scanner of this folder counts its angles.
        lidar_model: free text.
        decimals: of metres; angles get one and two-way-ranging periods twelve more (1 ps is
            0.3 mm). None writes all digits: the folder then reads back bit by bit, save for
            angles that no float of degrees hits, which return within one unit in the last place.

    Raises:
        SlamUwbError: `folder` is there, not empty and no survey folder.
        ValueError: what one survey.toml cannot say (two `max_range`; a tag height here, none there).
    """
    refuse_foreign(folder, SURVEY_TOML, "survey folder")
    recorded = _scans(survey, angle_direction, decimals) | _rows(survey, decimals)
    files = _compressed(recorded) if compress else recorded
    suffix = ".gz" if compress else ""
    files[SURVEY_TOML] = survey_toml(survey, suffix, angle_direction, lidar_model).encode()
    # Never compressed: a person edits this one.
    files |= _decisions(survey.decisions, decimals)
    replace_folder(folder, files | _reference_files(reference, link_truth))


def _compressed(files: Mapping[str, bytes]) -> dict[str, bytes]:
    # Without name and time of writing, equal contents are equal files.
    return {f"{name}.gz": gzip.compress(data, 6, mtime=0) for name, data in files.items()}


def _scans(survey: Survey, angle_direction: str, decimals: int | None) -> dict[str, bytes]:
    return {
        f"{name}.csv": _scan_csv(scan, angle_direction, decimals)
        for station in survey.stations
        for _, name, scan in recordings(station)
    }


def _scan_csv(scan: Scan, angle_direction: str, decimals: int | None) -> bytes:
    sign = 1.0 if angle_direction == "ccw" else -1.0
    angles = csv_text.numbers(
        sign * degrees_from_radians(scan.bearings), None if decimals is None else decimals + 1
    )
    return csv_text.columns(
        ("angle_deg", "range_m"), angles, csv_text.numbers(scan.ranges, decimals)
    )


def _rows(survey: Survey, decimals: int | None) -> dict[str, bytes]:
    """ranges.csv, twr.csv and anchor_ranges.csv, those that the survey has."""
    exact = None if decimals is None else decimals + 12
    files: dict[str, bytes] = {}
    if survey.ranges:
        files["ranges.csv"] = csv_text.table(
            ("station", "anchor", "range_m"),
            _distances(
                ((link.station, link.anchor, link.distances) for link in survey.ranges), decimals
            ),
        )
    if survey.periods:
        files["twr.csv"] = csv_text.table(
            ("station", "anchor", *PERIODS),
            (
                (link.station, link.anchor, *(_as_measured(period, exact) for period in exchange))
                for link in survey.periods
                for exchange in link.periods.tolist()
            ),
        )
    if survey.anchor_ranges:
        files["anchor_ranges.csv"] = csv_text.table(
            ("anchor_a", "anchor_b", "range_m"),
            _distances(
                ((link.anchor_a, link.anchor_b, link.distances) for link in survey.anchor_ranges),
                decimals,
            ),
        )
    return files


def _distances(
    links: Iterable[tuple[str, str, FloatArray]], decimals: int | None
) -> Iterator[tuple[str, str, str]]:
    """One row a distance, m, of links between two ends."""
    for a, b, distances in links:
        for distance in distances.tolist():
            yield a, b, _as_measured(distance, decimals)


def _as_measured(value: float, decimals: int | None) -> str:
    # What a device gave is kept even where it is absurd: `inf` is not the same as nothing.
    return csv_text.number(value, decimals) if math.isfinite(value) else repr(value)


def _decisions(decisions: Sequence[Decision], decimals: int | None) -> dict[str, bytes]:
    """decisions.csv, where there are any."""
    if not decisions:
        return {}
    more = None if decimals is None else decimals + 1
    rows = []
    for item in decisions:
        guess = item.guess
        pose = [""] * 3
        if guess is not None:
            yaw = float(degrees_from_radians(guess.theta))
            pose = [csv_text.number(value, more) for value in (guess.x, guess.y, yaw)]
        rows.append((item.kind, item.a, item.b, item.verdict, *pose))
    header = ("kind", "a", "b", "decision", "dx_m", "dy_m", "dyaw_deg")
    return {"decisions.csv": csv_text.table(header, rows)}


def _reference_files(
    reference: Reference | None, links: Mapping[tuple[str, str], tuple[int, float]] | None
) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    if reference is not None:
        files["reference/anchors.csv"] = csv_text.table(
            ("anchor", "x_m", "y_m"),
            ((name, *_place(place)[:2]) for name, place in reference.anchors.items()),
        )
        files["reference/stations.csv"] = csv_text.table(
            ("station", "x_m", "y_m", "yaw_deg"),
            ((name, *_place(place)) for name, place in reference.stations.items()),
        )
    if links is not None:
        files["reference/links.csv"] = csv_text.table(
            ("station", "anchor", "walls", "error_m"),
            (
                (station, anchor, walls, csv_text.number(error, _TRUTH_DECIMALS))
                for (station, anchor), (walls, error) in links.items()
            ),
        )
    return files


def _place(place: ReferencePlace) -> list[str]:
    values = (place.x, place.y, float(degrees_from_radians(place.theta)))
    return [csv_text.number(value, _TRUTH_DECIMALS) for value in values]
