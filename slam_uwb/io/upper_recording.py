"""The raised scan of a station, written while it is recorded."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..model.errors import SlamUwbError
from ..model.geometry import FloatArray
from .growing_survey import check_height, put_upper_scan, recorded_stations
from .scan_recording import RawFiles, ScanFiles, free_aside, log_file, move_aside


@dataclass(slots=True)
class UpperRecording:
    """Takes samples of the raised scanner.

    survey.toml names the scan once it is whole: the format has no word for one that broke off, and a
    station is as good without.
    """

    folder: Path
    station: str
    height_m: float
    scan: ScanFiles
    raw: RawFiles

    def add_scan(
        self, bearings: FloatArray, ranges: FloatArray, times: FloatArray, signals: FloatArray
    ) -> None:
        """(N,) samples: rad counter-clockwise, m (NaN: no return), s, device's units."""
        self.scan.add(bearings, ranges, times, signals)

    def add_range(self, *_: object) -> None:
        """Passed over: the tag may hang higher than the survey says."""

    def add_anchor_range(self, *_: object) -> None:
        """Passed over likewise."""

    def add_raw(self, device: str, data: bytes) -> None:
        """Bytes as they came."""
        self.raw.add(device, data)

    def flush(self) -> None:
        """Make durable what was added."""
        self.raw.flush()
        self.scan.flush()

    def finish(self, *, complete: bool, log: Mapping[str, Any]) -> None:
        """Flush, name the scan in survey.toml if it ran its time and saw anything, and write how it went."""
        self.flush()
        self.raw.close()
        if complete and self.scan.returns:
            put_upper_scan(self.folder, self.station, files=self.scan.files, height_m=self.height_m)
        path = log_file(self.folder, self.scan.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(dict(log), indent=2) + "\n", encoding="utf-8")


@contextmanager
def recording_upper_scan(
    folder: Path, station: str, *, height_m: float, epoch: float, keep_raw: bool = False
) -> Iterator[UpperRecording]:
    """A raised scan to record; an earlier one of the station is moved to ``recordings/replaced``.

    Args:
        folder: of the survey.
        station: one that has a scan.
        height_m: of the scanner above the floor.
        epoch: s from the survey's zero of time to the start of this recording.
        keep_raw: whether `add_raw` writes.

    Raises:
        SlamUwbError: there is no scan of that station; or no height.
    """
    check_height(height_m)
    known = recorded_stations(folder).get(station)
    if known is None or not known.files:
        raise SlamUwbError(f"station {station}: a raised scan needs the station's own scan first")
    name = f"upper/{station}"
    put_upper_scan(folder, station, files=(), height_m=height_m)
    move_aside(folder, name, known.upper_files, free_aside(folder, station))
    recording = UpperRecording(
        folder, station, height_m, ScanFiles(folder, name, epoch), RawFiles(folder, name, keep_raw)
    )
    try:
        yield recording
    finally:
        recording.raw.close()
