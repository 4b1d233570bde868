"""Point clouds (PCD, PLY, LAS, E57), sliced at a height band into what a 2-D scanner at their origin would see."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...model.errors import Fault, MissingLibraryError, SurveyFormatError
from ...model.geometry import FloatArray
from .scans import Polar

MAX_CLOUD_BYTES = 4_000_000_000
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
        raise _fault(
            path, f"none of {len(points):,} points has z from {band[0]:g} to {band[1]:g} m"
        )
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
    try:
        return np.asarray(laspy.read(path).xyz, dtype=np.float64)
    except (laspy.errors.LaspyException, OSError, ValueError) as error:
        raise _fault(path, f"no LAS file: {error}") from None


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
    ".e57": _pye57,
}


def _missing(path: Path, extra: str) -> MissingLibraryError:
    return MissingLibraryError(f'{path.name}: install its reader: pip install "slam-uwb[{extra}]"')


def _fault(path: Path, problem: str) -> SurveyFormatError:
    return SurveyFormatError([Fault(str(path), problem)])
