"""One station of a survey folder, written while it is recorded: a crash loses what was not flushed, no more."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from ..model.errors import SlamUwbError
from ..model.geometry import FloatArray
from . import csv_text
from .degrees import degrees_from_radians
from .growing_survey import (
    check_station_name,
    put_station,
    recorded_stations,
    remove_station,
)
from .row_files import append_durably, rewrite_rows

SCAN_HEADER = ("angle_deg", "range_m", "time_s", "signal")
RANGES_HEADER = ("station", "anchor", "range_m", "time_s", "rss_dbm", "quality")
ANCHOR_RANGES_HEADER = ("anchor_a", "anchor_b", "range_m", "time_s")
MAX_SCAN_BYTES = 150_000_000
"""A longer recording goes on in a further file: a reader takes files of 200 MB."""
LOG_FOLDER = "recordings"
"""Beside the survey's own files: how each recording went, raw bytes, what was recorded again."""


@dataclass(slots=True)
class StationRecording:
    """Takes samples of one station; times in s since the recording began, `epoch` s after the survey's zero.

    The station is in survey.toml, with ``complete = false``, from the first flush on that wrote anything.
    """

    folder: Path
    station: str
    epoch: float
    keep_raw: bool
    max_scan_bytes: int = MAX_SCAN_BYTES
    files: list[str] = field(default_factory=list)
    returns: int = 0
    _scan: list[bytes] = field(default_factory=list)
    _ranges: list[str] = field(default_factory=list)
    _anchor_ranges: list[str] = field(default_factory=list)
    _raw: dict[str, IO[bytes]] = field(default_factory=dict)
    _listed: tuple[tuple[str, ...], bool] | None = None
    """What survey.toml says: files, complete."""

    def add_scan(
        self, bearings: FloatArray, ranges: FloatArray, times: FloatArray, signals: FloatArray
    ) -> None:
        """(N,) samples: rad counter-clockwise, m (NaN: no return), s, device's units."""
        text = csv_text.columns(
            SCAN_HEADER,
            csv_text.numbers(degrees_from_radians(bearings) % 360.0, 4),
            csv_text.numbers(ranges, 3),
            csv_text.numbers(times + self.epoch, 3),
            csv_text.numbers(signals, 0),
        )
        self.returns += int((ranges > 0.0).sum())
        self._scan.append(text.partition(b"\n")[2])

    def add_range(
        self, anchor: str, distance: float, time: float, rss_dbm: float, quality: str
    ) -> None:
        """One distance from the tag, m."""
        cells = (
            self.station,
            anchor,
            csv_text.number(distance, 3),
            csv_text.number(time + self.epoch, 3),
            csv_text.number(rss_dbm, 2),
            # A device's own words, in a table whose cells are never quoted.
            "".join(c if c.isalnum() or c in "._-" else "_" for c in quality)[:40],
        )
        self._ranges.append(",".join(cells) + "\n")

    def add_anchor_range(self, anchor_a: str, anchor_b: str, distance: float, time: float) -> None:
        """One distance between two anchors, m."""
        cells = (csv_text.number(distance, 3), csv_text.number(time + self.epoch, 3))
        self._anchor_ranges.append(",".join((anchor_a, anchor_b, *cells)) + "\n")

    def add_raw(self, device: str, data: bytes) -> None:
        """Bytes as they came, for ``recordings/``; passed over unless they are to be kept."""
        if not self.keep_raw:
            return
        if device not in self._raw:
            path = self.folder / LOG_FOLDER / "raw" / self.station / f"{device}.bin"
            path.parent.mkdir(parents=True, exist_ok=True)
            self._raw[device] = path.open("wb")
        self._raw[device].write(data)

    def flush(self) -> None:
        """Make durable what was added; the scan first, since survey.toml must not name a file without returns."""
        for stream in self._raw.values():
            stream.flush()
        if self._scan:
            self._flush_scan()
        self._list_in_survey(complete=False)
        if self._listed:
            _append(self.folder / "ranges.csv", RANGES_HEADER, self._ranges)
            _append(self.folder / "anchor_ranges.csv", ANCHOR_RANGES_HEADER, self._anchor_ranges)

    def finish(self, *, complete: bool, log: Mapping[str, Any]) -> None:
        """Flush, note whether the recording ran its time, and write how it went to ``recordings/``."""
        self.flush()
        self.close()
        self._list_in_survey(complete=complete)
        path = _log_file(self.folder, self.station)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(dict(log), indent=2) + "\n", encoding="utf-8")

    def close(self) -> None:
        """Close what is open; what is flushed stays."""
        for stream in self._raw.values():
            stream.close()

    def _list_in_survey(self, *, complete: bool) -> None:
        """Say in survey.toml what there is: files without returns and rows without station would be faults."""
        files = tuple(self.files) if self.returns else ()
        if not (files or self._ranges or self._listed) or self._listed == (files, complete):
            return
        put_station(self.folder, self.station, files=files, complete=complete)
        self._listed = (files, complete)

    def _flush_scan(self) -> None:
        data = b"".join(self._scan)
        self._scan.clear()
        if self.files:
            current = self.folder / self.files[-1]
            if current.stat().st_size < self.max_scan_bytes:
                append_durably(current, data)
                return
        # Parts lie in a folder of their own: a station may be called s01-2.
        name = f"scans/parts/{self.station}/{len(self.files) + 1}.csv"
        self.files.append(name if self.files else f"scans/{self.station}.csv")
        fresh = self.folder / self.files[-1]
        fresh.parent.mkdir(parents=True, exist_ok=True)
        append_durably(fresh, (",".join(SCAN_HEADER) + "\n").encode() + data)


@contextmanager
def recording_station(
    folder: Path, station: str, *, epoch: float, keep_raw: bool = False
) -> Iterator[StationRecording]:
    """A station to record into; what was recorded of it before is moved to ``recordings/replaced``.

    Args:
        folder: of a survey that `start_survey` made or found.
        station: its identifier.
        epoch: s from the survey's zero of time to the start of this recording.
        keep_raw: whether `add_raw` writes.

    Raises:
        SlamUwbError: no identifier; or another station's name but for upper and lower case.
    """
    check_station_name(station)
    _refuse_look_alike(folder, station)
    set_aside(folder, station)
    recording = StationRecording(folder, station, epoch, keep_raw)
    try:
        yield recording
    finally:
        recording.close()


def set_aside(folder: Path, station: str) -> None:
    """Take the recordings of a station out of the survey; nothing is deleted.

    Ranges go first: rows of a station that survey.toml does not list would be a fault.
    """
    log = folder / LOG_FOLDER
    replaced = log / "replaced" / station
    number = 1 + sum(1 for _ in replaced.glob("*")) if replaced.is_dir() else 1
    aside = replaced / str(number)
    rewrite_rows(
        folder / "ranges.csv",
        RANGES_HEADER,
        lambda row: row["station"] != station,
        aside / "ranges.csv",
    )
    rewrite_rows(
        folder / "anchor_ranges.csv", ANCHOR_RANGES_HEADER, lambda _row: True, aside / "none.csv"
    )
    known = recorded_stations(folder).get(station)
    remove_station(folder, station)
    # A crash may have left a file that survey.toml does not name yet.
    names = {f"scans/{station}.csv", *(known.files if known else ())}
    files = [folder / name for name in sorted(names)] + [_log_file(folder, station)]
    for part in (folder / "scans" / "parts" / station, log / "raw" / station):
        files += sorted(part.iterdir()) if part.is_dir() else []
    for file in files:
        if file.is_file() and file.resolve().is_relative_to(folder.resolve()):
            aside.mkdir(parents=True, exist_ok=True)
            file.replace(aside / f"{file.parent.name}-{file.name}")


def _log_file(folder: Path, station: str) -> Path:
    return folder / LOG_FOLDER / "log" / f"{station}.json"


def _refuse_look_alike(folder: Path, station: str) -> None:
    """Some file systems ignore case: S1 would overwrite s1."""
    for other in recorded_stations(folder):
        if other != station and other.lower() == station.lower():
            raise SlamUwbError(f"station {station}: there is a station {other} already")


def _append(path: Path, header: tuple[str, ...], rows: list[str]) -> None:
    if not rows:
        return
    start = "" if path.exists() else ",".join(header) + "\n"
    append_durably(path, (start + "".join(rows)).encode())
    rows.clear()
