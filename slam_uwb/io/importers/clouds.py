"""Point clouds (PCD, PLY, LAS, LAZ, E57), sliced at a height band into what a 2-D scanner there would see."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...model.errors import Fault, MissingLibraryError, SurveyFormatError
from ...model.geometry import FloatArray
from .scans import Polar, outside_band

MAX_CLOUD_BYTES = 4_000_000_000
_MAX_POINTS_PER_BYTE = 4
"""Real clouds pack a point into some bytes; a small file may claim any number."""
_RECORD_BYTES = 54
"""Of the header of a LAS file's variable length record."""
_STEP = np.deg2rad(0.25)
"""Of the bearings: the nearest return of each is what a scanner sees."""


def read_cloud(path: Path, band: tuple[float, float]) -> Polar:
    """Nearest point of each quarter of a degree among those with z in `band` m, about the cloud's origin.

    Raises:
        SurveyFormatError: the file cannot be read, is too large, or has nothing in the band.
        MissingLibraryError: the library for this format is not installed.
    """
    size = path.stat().st_size
    if size > MAX_CLOUD_BYTES:
        raise _fault(path, f"holds {size:,} bytes, the limit is {MAX_CLOUD_BYTES:,}")
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise _fault(path, f"expected one of {', '.join(_READERS)}")
    points = read(path)
    level = points[(points[:, 2] >= band[0]) & (points[:, 2] <= band[1])]
    ranges = np.hypot(level[:, 0], level[:, 1])
    level, ranges = level[ranges > 0.05], ranges[ranges > 0.05]
    if not len(level):
        raise _fault(path, outside_band(len(points), band))
    bins = np.floor(np.arctan2(level[:, 1], level[:, 0]) / _STEP).astype(np.int64)
    order = np.lexsort([ranges, bins])
    first = order[np.unique(bins[order], return_index=True)[1]]
    return np.arctan2(level[first, 1], level[first, 0]), ranges[first]


def _open3d(path: Path) -> FloatArray:
    try:
        import open3d
    except (ImportError, OSError):
        raise _missing(path, "open3d") from None
    # It prints its own warnings to stdout and returns an empty cloud where it cannot read.
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        points = np.asarray(open3d.io.read_point_cloud(path).points, dtype=np.float64)
    if not len(points):
        raise _fault(path, "no points, or no such file format")
    return points[np.isfinite(points).all(axis=1)]


def _laspy(path: Path) -> FloatArray:
    try:
        import laspy
    except ImportError:
        raise _missing(path, "clouds") from None
    size = path.stat().st_size
    try:
        _refuse_claims(path, size)
        with laspy.open(path) as file:
            number, limit = file.header.point_count, _MAX_POINTS_PER_BYTE * size
            if number > limit:
                raise _fault(path, f"claims {number:,} points, the limit for its size is {limit:,}")
            return np.asarray(file.read().xyz, dtype=np.float64)
    except SurveyFormatError:
        raise
    except Exception as error:
        # The unpacking library raises its own types beside those of laspy.
        if path.suffix.lower() == ".laz" and not laspy.LazBackend.detect_available():
            raise _missing(path, "clouds") from None
        raise _fault(path, f"no LAS file: {error}") from None


def _refuse_claims(path: Path, size: int) -> None:
    """SurveyFormatError where a LAS header counts more records than the file has room for.

    The library believes the counts: a file of some bytes would keep it busy for hours.
    """
    with path.open("rb") as file:
        head = file.read(247).ljust(247, b"\0")
    # LAS 1.4, table 3: variable length records at byte 100, from 1.4 on extended ones at byte 243.
    (records,) = struct.unpack_from("<I", head, 100)
    (extended,) = struct.unpack_from("<I", head, 243) if head[25] >= 4 else (0,)
    if _RECORD_BYTES * (records + extended) > size:
        raise _fault(path, f"no LAS file: claims {records + extended:,} records in {size:,} bytes")


def _pye57(path: Path) -> FloatArray:
    try:
        import pye57
    except ImportError:
        raise _missing(path, "clouds") from None
    try:
        with pye57.E57(str(path)) as file:
            # In the scanner's own frame: the band is about its height.
            data = file.read_scan(0, transform=False, ignore_missing_fields=True)
    except Exception as error:
        # The library raises its own types, unrelated to each other.
        raise _fault(path, f"no E57 file: {error}") from None
    return np.column_stack([data[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)


_READERS: dict[str, Callable[[Path], FloatArray]] = {
    ".pcd": _open3d,
    ".ply": _open3d,
    ".las": _laspy,
    ".laz": _laspy,
    ".e57": _pye57,
}


def _missing(path: Path, extra: str) -> MissingLibraryError:
    return MissingLibraryError(f'{path.name}: install its reader: pip install "slam-uwb[{extra}]"')


def _fault(path: Path, problem: str) -> SurveyFormatError:
    return SurveyFormatError([Fault(str(path), problem)])
