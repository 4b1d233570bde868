"""Poses as TUM trajectories, which `evo` and other tools of SLAM read (Sturm et al., IROS 2012).

Each line has a time stamp and a pose in space. Stations have no order that matters: the time stamp is the
station's number in its survey, so that tools pair the poses of two files by it. The plane is z = 0 and a
heading is a turn about z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..model.geometry import Pose2


def poses_to_tum(poses: Mapping[int, Pose2]) -> str:
    """`timestamp tx ty tz qx qy qz qw`, m, one line a pose by its number."""
    return "".join(_line(number, pose) for number, pose in poses.items())


def _line(number: int, pose: Pose2) -> str:
    sine, cosine = math.sin(pose.theta / 2.0), math.cos(pose.theta / 2.0)
    return f"{number}.0 {pose.x:.9f} {pose.y:.9f} 0 0 0 {sine:.12f} {cosine:.12f}\n"
