"""Files of one or several stations -> a survey and, where the files tell, what is known of its poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...model.errors import Fault, SlamUwbError, SurveyFormatError
from ...model.geometry import FloatArray, Pose2
from ...model.survey import (
    Anchor,
    AnchorId,
    RangeSamples,
    Reference,
    ReferencePlace,
    Scan,
    Station,
    StationId,
    Survey,
)
from ..files import FileContent
from .bags import read_bag
from .carmen import read_carmen
from .clouds import read_cloud
from .ranges import Links, ParseLine, read_log, read_range_csv
from .scans import Polar, read_frame_grabber, read_plain_csv, read_sweep_csv
from .source import read_source, station_name

_TEXT: dict[str, Callable[[FileContent, tuple[float, float]], Polar]] = {
    "sweep-csv": read_sweep_csv,
    "frame-grabber": read_frame_grabber,
    "csv": read_plain_csv,
}
SCAN_FORMATS = (*_TEXT, "carmen", "bag", "cloud")
RANGE_FORMATS = ("dwm1001-log", "trek1000-log", "ranges-csv")


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What the files do not say."""

    name: str
    max_range: float = 40.0
    """m."""
    band: tuple[float, float] = (-0.1, 0.1)
    """m, z of the points of a cloud that the scan is made of."""
    spacing: float = 2.0
    """m between stations chosen from a robot's log."""
    merge: float = 0.3
    """m from a station within which a robot's scans are put together."""
    tag_height: float | None = None
    """m; needed where there are ranges."""
    tag: str | None = None
    """As a log names it that holds several; None where there is one."""
    heights: Mapping[str, float] = field(default_factory=dict)
    """m, of anchors above the floor."""
    parsers: Mapping[str, ParseLine] = field(default_factory=dict)
    """Of the lines of logs, by format."""


@dataclass(slots=True)
class _Gathered:
    """Recordings by station, in the order of the files."""

    scans: dict[str, list[Polar]] = field(default_factory=dict)
    links: dict[str, Links] = field(default_factory=dict)
    poses: dict[str, Pose2] = field(default_factory=dict)

    def add_scan(self, path: Path, scan: Polar, max_range: float) -> None:
        _require_returns(path, scan[1], max_range)
        self.scans.setdefault(station_name(path), []).append(scan)

    def add_links(self, station: str, links: Links) -> None:
        known = self.links.setdefault(station, {})
        for anchor, distances in links.items():
            known.setdefault(anchor, []).extend(distances)


def import_survey(
    form: str, files: Sequence[Path], ranges: Sequence[tuple[str, Path]], options: ImportOptions
) -> tuple[Survey, Reference | None]:
    """Read recordings of other programs.

    The name of a file up to its ending is its station's; a CARMEN log holds many stations, named s01, s02, ...

    Args:
        form: one of `SCAN_FORMATS` or `RANGE_FORMATS`, of `files`.
        files: recordings.
        ranges: further files with distances, each with its one of `RANGE_FORMATS`.
        options: what the files do not say.

    Returns:
        The survey, and the poses that a robot's log tells (None without).

    Raises:
        SurveyFormatError: names file, line and field.
        SlamUwbError: an option is missing or a name cannot be a station's.
    """
    for kind, path in ranges:
        if kind not in RANGE_FORMATS:
            raise SlamUwbError(
                f"{path}: {kind!r} is no format of ranges (--ranges); there are: "
                f"{', '.join(RANGE_FORMATS)}"
            )
    gathered = _Gathered()
    for path in files:
        _read_into(gathered, form, path, options)
    for kind, path in ranges:
        _read_into(gathered, kind, path, options)
    if gathered.links and options.tag_height is None:
        raise SlamUwbError(
            "there are ranges: the height of the tag's antenna above the floor is needed "
            "(--tag-height-m)"
        )
    return _survey(gathered, options), _reference(gathered.poses)


def _read_into(gathered: _Gathered, form: str, path: Path, options: ImportOptions) -> None:
    if form == "carmen":
        found = read_carmen(
            read_source(path),
            spacing=options.spacing,
            merge=options.merge,
            max_range=options.max_range,
        )
        if not any(np.isfinite(ranges).any() for _, (_, ranges) in found):
            problem = f"no return within {options.max_range:g} m (--max-range-m)"
            raise SurveyFormatError([Fault(str(path), problem)])
        for pose, scan in found:
            name = f"s{len(gathered.scans) + 1:02d}"
            gathered.scans[name], gathered.poses[name] = [scan], pose
        return
    station = station_name(path)
    if form in _TEXT:
        gathered.add_scan(path, _TEXT[form](read_source(path), options.band), options.max_range)
    elif form == "cloud":
        gathered.add_scan(path, read_cloud(path, options.band), options.max_range)
    elif form == "bag":
        samples, links = read_bag(path)
        if samples is not None:
            gathered.add_scan(path, samples, options.max_range)
        if links:
            gathered.add_links(station, links)
    elif form == "ranges-csv":
        gathered.add_links(station, read_range_csv(read_source(path)))
    elif form in options.parsers:
        gathered.add_links(station, read_log(read_source(path), options.parsers[form], options.tag))
    else:
        known = ", ".join((*SCAN_FORMATS, *RANGE_FORMATS))
        raise SlamUwbError(f"unknown format {form!r}; there are: {known}")


def _require_returns(path: Path, ranges: FloatArray, max_range: float) -> None:
    """SurveyFormatError where a scan has no return that counts: it would be placed nowhere."""
    met = int(np.isfinite(ranges).sum())
    if met and not (ranges <= max_range).any():
        problem = f"none of {met:,} returns is within {max_range:g} m (--max-range-m): are they in metres?"
        raise SurveyFormatError([Fault(str(path), problem)])
    if not met:
        raise SurveyFormatError([Fault(str(path), "no return in it")])


def _survey(gathered: _Gathered, options: ImportOptions) -> Survey:
    names = list(dict.fromkeys([*gathered.scans, *gathered.links]))
    tag_height = float("nan") if options.tag_height is None else options.tag_height
    heard = sorted({anchor for links in gathered.links.values() for anchor in links})
    return Survey(
        name=options.name,
        stations=tuple(
            Station(StationId(name), _scan(gathered.scans.get(name), options), tag_height)
            for name in names
        ),
        anchors=tuple(Anchor(AnchorId(name), options.heights.get(name)) for name in heard),
        ranges=tuple(
            RangeSamples(StationId(station), AnchorId(anchor), np.array(distances))
            for station, links in gathered.links.items()
            for anchor, distances in links.items()
        ),
    )


def _scan(parts: list[Polar] | None, options: ImportOptions) -> Scan | None:
    if not parts:
        return None
    bearings, ranges = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Scan(bearings, np.where(ranges <= options.max_range, ranges, np.nan), options.max_range)


def _reference(poses: Mapping[str, Pose2]) -> Reference | None:
    if not poses:
        return None
    return Reference(
        {StationId(name): ReferencePlace(p.x, p.y, p.theta) for name, p in poses.items()}, {}
    )
