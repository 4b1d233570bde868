"""What every recording of a scanner writes: samples in one file or several, and raw bytes on request."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from ..model.geometry import FloatArray
from . import csv_text
from .degrees import degrees_from_radians
from .row_files import append_durably

SCAN_HEADER = ("angle_deg", "range_m", "time_s", "signal")
MAX_SCAN_BYTES = 150_000_000
"""A longer recording goes on in a further file: a reader takes files of 200 MB."""
LOG_FOLDER = "recordings"
"""Beside the survey's own files: how each recording went, raw bytes, what was recorded again."""


@dataclass(slots=True)
class ScanFiles:
    """A scan that grows below ``scans/``."""

    folder: Path
    name: str
    """``s01``, or ``upper/s01`` for the raised one: a station may be called s01-upper."""
    epoch: float
    """S after the survey's zero of time at which the recording began."""
    max_bytes: int = MAX_SCAN_BYTES
    files: list[str] = field(default_factory=list)
    returns: int = 0
    _held: list[bytes] = field(default_factory=list)

    def add(
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
        self._held.append(text.partition(b"\n")[2])

    def flush(self) -> None:
        """Make durable what was added."""
        if not self._held:
            return
        data = b"".join(self._held)
        self._held.clear()
        if self.files:
            current = self.folder / self.files[-1]
            if current.stat().st_size < self.max_bytes:
                append_durably(current, data)
                return
        # Parts lie in a folder of their own: a station may be called s01-2.
        part = f"scans/parts/{self.name}/{len(self.files) + 1}.csv"
        self.files.append(part if self.files else f"scans/{self.name}.csv")
        fresh = self.folder / self.files[-1]
        fresh.parent.mkdir(parents=True, exist_ok=True)
        append_durably(fresh, (",".join(SCAN_HEADER) + "\n").encode() + data)


@dataclass(slots=True)
class RawFiles:
    """Bytes as they came, a file a device; nothing where they are not to be kept."""

    folder: Path
    name: str
    keep: bool
    _open: dict[str, IO[bytes]] = field(default_factory=dict)

    def add(self, device: str, data: bytes) -> None:
        """Take what a device sent."""
        if not self.keep:
            return
        if device not in self._open:
            path = self.folder / LOG_FOLDER / "raw" / self.name / f"{device}.bin"
            path.parent.mkdir(parents=True, exist_ok=True)
            self._open[device] = path.open("wb")
        self._open[device].write(data)

    def flush(self) -> None:
        """Hand what was added to the system."""
        for stream in self._open.values():
            stream.flush()

    def close(self) -> None:
        """Close what is open; what is flushed stays."""
        for stream in self._open.values():
            stream.close()


def move_aside(folder: Path, name: str, known: tuple[str, ...], aside: Path) -> None:
    """Move the files of a recording, with its log and raw bytes, to `aside`; nothing is deleted.

    Args:
        folder: of the survey.
        name: as of `ScanFiles`.
        known: files that survey.toml names; a crash may have left one that it does not.
        aside: is made where there is something to move.
    """
    names = sorted({f"scans/{name}.csv", *known})
    files = [folder / file for file in names] + [log_file(folder, name)]
    for part in (folder / "scans" / "parts" / name, folder / LOG_FOLDER / "raw" / name):
        files += sorted(part.iterdir()) if part.is_dir() else []
    for file in files:
        if file.is_file() and file.resolve().is_relative_to(folder.resolve()):
            aside.mkdir(parents=True, exist_ok=True)
            file.replace(aside / f"{file.parent.name}-{file.name}")


def free_aside(folder: Path, station: str) -> Path:
    """The next folder for what is recorded again of a station."""
    replaced = folder / LOG_FOLDER / "replaced" / station
    number = 1 + sum(1 for _ in replaced.glob("*")) if replaced.is_dir() else 1
    return replaced / str(number)


def log_file(folder: Path, name: str) -> Path:
    """Where it is told how a recording went."""
    return folder / LOG_FOLDER / "log" / f"{name}.json"
