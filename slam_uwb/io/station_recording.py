"""One station of a survey folder, written while it is recorded: a crash loses what was not flushed, no more."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..model.errors import SlamUwbError
from ..model.geometry import FloatArray
from . import csv_text
from .growing_survey import (
    check_station_name,
    put_station,
    recorded_stations,
    remove_station,
)
from .row_files import append_durably, rewrite_rows
from .scan_recording import RawFiles, ScanFiles, free_aside, log_file, move_aside

RANGES_HEADER = ("station", "anchor", "range_m", "time_s", "rss_dbm", "quality")
ANCHOR_RANGES_HEADER = ("anchor_a", "anchor_b", "range_m", "time_s")


@dataclass(slots=True)
class StationRecording:
    """Takes samples of one station; times in s since the recording began, `epoch` s after the survey's zero.

    The station is in survey.toml, with ``complete = false``, from the first flush on that wrote anything.
    """

    folder: Path
    station: str
    epoch: float
    scan: ScanFiles
    raw: RawFiles
    _ranges: list[str] = field(default_factory=list)
    _anchor_ranges: list[str] = field(default_factory=list)
    _listed: tuple[tuple[str, ...], bool] | None = None
    """What survey.toml says: files, complete."""

    def add_scan(
        self, bearings: FloatArray, ranges: FloatArray, times: FloatArray, signals: FloatArray
    ) -> None:
        """(N,) samples: rad counter-clockwise, m (NaN: no return), s, device's units."""
        self.scan.add(bearings, ranges, times, signals)

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
        self.raw.add(device, data)

    def flush(self) -> None:
        """Make durable what was added; the scan first, since survey.toml must not name a file without returns."""
        self.raw.flush()
        self.scan.flush()
        self._list_in_survey(complete=False)
        if self._listed:
            _append(self.folder / "ranges.csv", RANGES_HEADER, self._ranges)
            _append(self.folder / "anchor_ranges.csv", ANCHOR_RANGES_HEADER, self._anchor_ranges)

    def finish(self, *, complete: bool, log: Mapping[str, Any]) -> None:
        """Flush, note whether the recording ran its time, and write how it went to ``recordings/``."""
        self.flush()
        self.close()
        self._list_in_survey(complete=complete)
        path = log_file(self.folder, self.station)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(dict(log), indent=2) + "\n", encoding="utf-8")

    def close(self) -> None:
        """Close what is open; what is flushed stays."""
        self.raw.close()

    def _list_in_survey(self, *, complete: bool) -> None:
        """Say in survey.toml what there is: files without returns and rows without station would be faults."""
        files = tuple(self.scan.files) if self.scan.returns else ()
        if not (files or self._ranges or self._listed) or self._listed == (files, complete):
            return
        put_station(self.folder, self.station, files=files, complete=complete)
        self._listed = (files, complete)


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
    recording = StationRecording(
        folder,
        station,
        epoch,
        ScanFiles(folder, station, epoch),
        RawFiles(folder, station, keep_raw),
    )
    try:
        yield recording
    finally:
        recording.close()


def set_aside(folder: Path, station: str) -> None:
    """Take the recordings of a station out of the survey; nothing is deleted.

    Ranges go first: rows of a station that survey.toml does not list would be a fault.
    """
    aside = free_aside(folder, station)
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
    move_aside(folder, station, known.files if known else (), aside)
    # The tripod may have moved: what it saw when it was raised goes with the rest.
    move_aside(folder, f"upper/{station}", known.upper_files if known else (), aside)


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
