"""CARMEN logs: a robot's laser scans with its own poses -> stations as a tripod would have stood there."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray, Pose2
from ..files import FileContent
from .scans import Polar, polar
from .source import fault, lines, numbers

_MAX_LINE = 100_000
"""Bytes; 1,080 beams with remissions take twenty thousand."""
_MAX_BEAMS = 10_000

Beams = tuple[Pose2, FloatArray, FloatArray]
"""Pose of the laser, (N,) rad, (N,) m with NaN for no return."""


def read_carmen(
    content: FileContent, *, spacing: float, merge: float, max_range: float
) -> list[tuple[Pose2, Polar]]:
    """Stations of a log: pose by the log, samples in the frame of that pose.

    The first scan is at a station; so is each later one that is `spacing` m from all stations before. What
    the robot saw within `merge` m of a station, in whatever direction, is put together by the log's own poses.

    Raises:
        SurveyFormatError: names line and field; also where there is no laser message.
    """
    scans = [
        scan for number, line in lines(content, _MAX_LINE) if (scan := _scan(content, number, line))
    ]
    if not scans:
        raise fault(content, None, None, "no FLASER or ROBOTLASER1 message")
    places = np.array([[pose.x, pose.y] for pose, _, _ in scans])
    chosen: list[int] = []
    for index, place in enumerate(places):
        if not chosen or np.linalg.norm(places[chosen] - place, axis=1).min() >= spacing:
            chosen.append(index)
    distances = np.linalg.norm(places[:, None] - places[chosen][None], axis=-1)
    owners = np.where(distances.min(axis=1) <= merge, distances.argmin(axis=1), -1)
    return [
        (scans[index][0], _merged(scans, np.flatnonzero(owners == k), scans[index][0], max_range))
        for k, index in enumerate(chosen)
    ]


def _merged(scans: list[Beams], members: NDArray[np.int64], at: Pose2, max_range: float) -> Polar:
    points = []
    for member in members:
        pose, bearings, ranges = scans[int(member)]
        met = ranges < max_range
        seen = ranges[met, None] * np.column_stack([np.cos(bearings[met]), np.sin(bearings[met])])
        points.append((at.inverse() @ pose).transform(seen))
    return polar(np.concatenate(points))


def _scan(content: FileContent, number: int, line: str) -> Beams | None:
    words = line.split()
    if not words or words[0] not in ("FLASER", "ROBOTLASER1"):
        return None
    return (
        _flaser(content, number, words)
        if words[0] == "FLASER"
        else _robotlaser(content, number, words)
    )


def _flaser(content: FileContent, number: int, words: list[str]) -> Beams:
    """FLASER n r1..rn x y theta odom_x odom_y odom_theta ...: half a circle, its angles implied."""
    count = _count(content, number, words, 1, "num_readings")
    values = _values(content, number, words, 2, count, "range")
    x, y, theta = _values(content, number, words, 2 + count, 3, "pose")
    # 181 beams are -90 to 90 degrees, 180 stop one degree earlier.
    step = np.pi / 180.0 if count in (180, 181) else np.pi / max(count - 1, 1)
    bearings: FloatArray = -np.pi / 2.0 + step * np.arange(count, dtype=np.float64)
    return Pose2(x, y, theta), bearings, _met(values)


def _robotlaser(content: FileContent, number: int, words: list[str]) -> Beams:
    """ROBOTLASER1 type start fov res maxrange accuracy remission_mode n r.. m rem.. laser pose (x y theta)."""
    start, _, resolution, reach = _values(content, number, words, 2, 4, "laser_parameters")
    count = _count(content, number, words, 8, "num_readings")
    values = np.array(_values(content, number, words, 9, count, "range"))
    remissions = _count(content, number, words, 9 + count, "num_remissions", least=0)
    x, y, theta = _values(content, number, words, 10 + count + remissions, 3, "laser_pose")
    ranges = _met(np.where(values >= reach, np.nan, values)) if reach > 0 else _met(values)
    bearings: FloatArray = start + resolution * np.arange(count, dtype=np.float64)
    return Pose2(x, y, theta), bearings, ranges


def _met(values: FloatArray | list[float]) -> FloatArray:
    ranges = np.asarray(values, dtype=np.float64)
    return np.where(ranges > 0.0, ranges, np.nan)


def _count(
    content: FileContent, number: int, words: list[str], place: int, name: str, least: int = 1
) -> int:
    text = words[place] if place < len(words) else ""
    if re.fullmatch(r"\d{1,5}", text) is None or not least <= int(text) <= _MAX_BEAMS:
        raise fault(content, number, name, f"{text!r}: expected {least} to {_MAX_BEAMS}")
    return int(text)


def _values(
    content: FileContent, number: int, words: list[str], start: int, count: int, name: str
) -> list[float]:
    fields = words[start : start + count]
    if len(fields) < count:
        raise fault(content, number, name, f"{len(fields)} values: expected {count}")
    return numbers(content, number, fields, [f"{name}[{k}]" for k in range(count)])
