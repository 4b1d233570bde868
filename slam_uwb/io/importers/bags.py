"""ROS 1 and 2 bags by `rosbags`: laser scans and range messages of one station."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...model.errors import Fault, MissingLibraryError, SurveyFormatError
from .scans import Polar

_SCAN, _RANGE = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Range"
_ROS1_BEGINS = b"#ROSBAG V"
MAX_SAMPLES = 50_000_000
"""Of one bag: an hour of a fast scanner."""


def read_bag(path: Path) -> tuple[Polar | None, dict[str, list[float]]]:
    """Samples of all LaserScan messages, and distances of all Range messages by their frame_id (the anchor).

    Angles are as the messages have them: counter-clockwise. Out of [range_min, range_max], inf and NaN are
    no return.

    Raises:
        SurveyFormatError: no bag, or neither kind of message in it.
        MissingLibraryError: rosbags is not installed.
    """
    if not path.exists():
        raise _fault(path, "no such file or folder")
    bearings, ranges, count = [], [], 0
    links: dict[str, list[float]] = {}
    for kind, message in _messages(path):
        if kind == _RANGE:
            links.setdefault(str(message.header.frame_id), []).append(float(message.range))
            continue
        values = np.asarray(message.ranges, dtype=np.float64)
        count += len(values)
        if count > MAX_SAMPLES:
            raise _fault(path, f"more than {MAX_SAMPLES:,} samples: cut the bag")
        valid = (values >= message.range_min) & (values <= message.range_max) & (values > 0)
        bearings.append(message.angle_min + message.angle_increment * np.arange(len(values)))
        ranges.append(np.where(valid, values, np.nan))
    if not bearings and not links:
        raise _fault(path, "neither sensor_msgs/LaserScan nor sensor_msgs/Range in it")
    scan = (np.concatenate(bearings), np.concatenate(ranges)) if bearings else None
    return scan, links


def _messages(path: Path) -> Iterator[tuple[str, Any]]:
    with _reader(path) as reader:
        wanted = [c for c in reader.connections if c.msgtype in (_SCAN, _RANGE)]
        # A bag without the wanted topics would otherwise be read whole.
        for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
            yield connection.msgtype, reader.deserialize(raw, connection.msgtype)


@contextmanager
def _reader(path: Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingLibraryError(
            f'{path.name}: install the reader of bags: pip install "slam-uwb[bags]"'
        ) from None
    if path.suffix == ".bag" and path.is_file():
        with path.open("rb") as stream:
            # The library looks for the end of the first line, however far off it is.
            if stream.read(len(_ROS1_BEGINS)) != _ROS1_BEGINS:
                raise _fault(path, f"no bag: it does not begin with {_ROS1_BEGINS.decode()}")
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except AnyReaderError as error:
        raise _fault(path, f"no bag: {error}") from None


def _fault(path: Path, problem: str) -> SurveyFormatError:
    return SurveyFormatError([Fault(str(path), problem)])
