"""survey.toml of a survey that is still being recorded: stations and anchors are added, comments stay.

Every change replaces the file as a whole.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from ..model.errors import Fault, SlamUwbError, SurveyFormatError
from .files import MAX_TOML_BYTES
from .survey_toml import IDENTIFIER, SURVEY_TOML

TIME_ZERO = "x_time_zero"
"""Our own key: the moment from which the survey's times count."""
_MAX_HEIGHT_M, _MIN_HEIGHT_M = 50.0, -10.0
"""The limits of the format: 245 is centimetres."""


@dataclass(frozen=True, slots=True)
class RecordedStation:
    """What survey.toml says of a station."""

    complete: bool
    files: tuple[str, ...]
    """Of its scan."""
    upper_files: tuple[str, ...] = ()
    """Of its raised scan."""


def start_survey(
    folder: Path, *, time_zero: datetime, lidar: Mapping[str, Any], tag: Mapping[str, Any]
) -> None:
    """Make a survey folder, or go on with the one that is there.

    Args:
        folder: new, empty, or a survey folder; what its survey.toml says already is kept.
        time_zero: now, in UTC.
        lidar: keys of [lidar]; empty without a scanner.
        tag: keys of [tag]; empty without ranges.

    Raises:
        SlamUwbError: the folder holds something else.
        SurveyFormatError: its survey.toml cannot be read.
    """
    path = folder / SURVEY_TOML
    if not path.exists():
        if (folder.exists() or folder.is_symlink()) and (
            not folder.is_dir() or any(folder.iterdir())
        ):
            raise SlamUwbError(f"{folder} exists and is no survey folder: nothing was changed")
        folder.mkdir(parents=True, exist_ok=True)
        document = tomlkit.document()
        document["format"] = 1
        document["name"] = folder.resolve().name
        _replace(path, tomlkit.dumps(document))

    def complete(document: Any) -> None:
        if TIME_ZERO not in document:
            document.add(TIME_ZERO, time_zero.astimezone(UTC).replace(microsecond=0))
        for name, keys in (("lidar", lidar), ("tag", tag)):
            if keys and name not in document:
                document[name] = dict(keys)

    _edit(folder, complete)


def read_time_zero(folder: Path) -> datetime | None:
    """The moment from which the survey's times count; None where it does not say."""
    value = _load(folder).get(TIME_ZERO)
    return value.astimezone(UTC) if isinstance(value, datetime) else None


def recorded_stations(folder: Path) -> dict[str, RecordedStation]:
    """The stations in survey.toml by identifier."""
    found = {}
    for table in _load(folder).get("stations", []):
        found[str(table["id"])] = RecordedStation(
            bool(table.get("complete", True)), _files(table, "scan"), _files(table, "upper_scan")
        )
    return found


def _files(table: Any, key: str) -> tuple[str, ...]:
    given = table.get(key, [])
    return (str(given),) if isinstance(given, str) else tuple(map(str, given))


def known_radios(folder: Path) -> dict[str, float | None]:
    """Height in m (None: not measured) by every name that ranges.csv may use for an anchor."""
    heights: dict[str, float | None] = {}
    for table in _load(folder).get("anchors", []):
        for key in ("id", "radio"):
            if key in table:
                height = table.get("height_m")
                heights[str(table[key])] = None if height is None else float(height)
    return heights


def put_station(folder: Path, station: str, *, files: Sequence[str], complete: bool) -> None:
    """Add a station, or change its recordings and whether it is complete."""

    def change(document: Any) -> None:
        table = _table(document, "stations", station)
        _put_files(table, "scan", files)
        table.pop("complete", None)
        if not complete:
            table["complete"] = False

    _edit(folder, change)


def put_upper_scan(folder: Path, station: str, *, files: Sequence[str], height_m: float) -> None:
    """Add the raised scan of a station that is there, or take it out where there are no `files`."""

    def change(document: Any) -> None:
        table = _table(document, "stations", station)
        _put_files(table, "upper_scan", files)
        table.pop("upper_scan_height_m", None)
        if files:
            table["upper_scan_height_m"] = float(height_m)

    _edit(folder, change)


def _put_files(table: Any, key: str, files: Sequence[str]) -> None:
    table.pop(key, None)
    if files:
        table[key] = files[0] if len(files) == 1 else list(files)


def remove_station(folder: Path, station: str) -> None:
    """Forget the recordings of a station; what else survey.toml says of it stays."""

    def change(document: Any) -> None:
        tables = document.get("stations", [])
        for index, table in enumerate(tables):
            if table.get("id") == station:
                for key in ("scan", "upper_scan", "upper_scan_height_m", "complete"):
                    table.pop(key, None)
                if set(table) == {"id"}:
                    del tables[index]
                break
        if "stations" in document and not tables:
            del document["stations"]

    _edit(folder, change)


def put_anchor(folder: Path, radio: str, height_m: float | None) -> None:
    """Add an anchor by its radio's identifier, or its height to one that is there.

    Raises:
        SlamUwbError: the identifier or the height is not one.
    """
    if re.match(IDENTIFIER, radio) is None:
        raise SlamUwbError(f"{radio!r}: an anchor's identifier is 1 to 64 of A-Z a-z 0-9 _ . -")
    if height_m is not None:
        check_height(height_m)

    def change(document: Any) -> None:
        tables = document.get("anchors", [])
        known = next((t for t in tables if radio in (t.get("id"), t.get("radio"))), None)
        table = _table(document, "anchors", radio) if known is None else known
        if height_m is not None:
            table["height_m"] = float(height_m)

    _edit(folder, change)


def check_height(height_m: float) -> None:
    """SlamUwbError where a height above the floor cannot be one in metres."""
    if not _MIN_HEIGHT_M <= height_m <= _MAX_HEIGHT_M:
        raise SlamUwbError(
            f"{height_m:g}: a height is {_MIN_HEIGHT_M:g} to {_MAX_HEIGHT_M:g}, in metres"
        )


def check_station_name(station: str) -> None:
    """SlamUwbError where this cannot be a station's identifier."""
    # Names become files here: none that begins with a dot.
    if re.match(IDENTIFIER, station) is None or not station[0].isalnum():
        raise SlamUwbError(
            f"{station!r}: a station's name is 1 to 64 of A-Z a-z 0-9 _ . -, a letter or digit first"
        )


def _table(document: Any, kind: str, name: str) -> Any:
    if kind not in document:
        document[kind] = tomlkit.aot()
    for table in document[kind]:
        if table.get("id") == name:
            return table
    table = tomlkit.table()
    table["id"] = name
    table.trivia.indent = "\n"
    document[kind].append(table)
    return document[kind][-1]


def _edit(folder: Path, change: Callable[[Any], None]) -> None:
    document = _load(folder)
    before = tomlkit.dumps(document)
    change(document)
    after = _text(document)
    if after != before:
        _replace(folder / SURVEY_TOML, after)


def _text(document: Any) -> str:
    """The document as text that says what it says: tomlkit can misplace tables after a removal."""
    text, meant = tomlkit.dumps(document), document.unwrap()
    try:
        if tomllib.loads(text) == meant:
            return text
    except ValueError:
        pass
    return tomlkit.dumps(meant)


def _load(folder: Path) -> Any:
    path = folder / SURVEY_TOML
    if path.stat().st_size > MAX_TOML_BYTES:
        raise SurveyFormatError([Fault(SURVEY_TOML, f"over {MAX_TOML_BYTES:,} bytes")])
    try:
        return tomlkit.parse(path.read_text(encoding="utf-8-sig"))
    except (TOMLKitError, ValueError) as error:
        raise SurveyFormatError([Fault(SURVEY_TOML, f"no TOML: {error}")]) from None


def _replace(path: Path, text: str) -> None:
    fresh = path.with_name(f".{path.name}.partial")
    with fresh.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    fresh.replace(path)
