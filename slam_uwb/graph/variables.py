"""What is solved for, as the model has it and as GTSAM has it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import gtsam
import numpy as np

from ..model.geometry import FloatArray, Points, Pose2, Vector2
from ..model.products import GraphProblem
from ..model.survey import AnchorId, StationId
from . import factors


@dataclass(frozen=True, slots=True, eq=False)
class Variables:
    """What is solved for, in one frame."""

    poses: dict[StationId, Pose2]
    """frame_T_station."""
    anchors: dict[AnchorId, Vector2]
    """(2,) m."""
    offset: float
    """m, common to all ranges."""
    delays: dict[AnchorId, float] = field(default_factory=dict)
    """m, by which the links of single anchors are longer than that."""

    def offset_of(self, anchor: AnchorId) -> float:
        """m, offset of an anchor's links."""
        return self.offset + self.delays.get(anchor, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The same as arrays: S poses, A anchors, and the offset of each anchor's links before the common one."""

    poses: FloatArray
    """(S, 3) x, y in m and theta in rad."""
    anchors: Points
    """(A, 2) m."""
    offsets: FloatArray
    """(A + 1,) m."""

    def movement(self, other: Places) -> float:
        """Largest change of anything; a radian counts as a metre."""
        poses = other.poses - self.poses
        turns = np.abs(np.arctan2(np.sin(poses[:, 2]), np.cos(poses[:, 2])))
        anchors = other.anchors - self.anchors
        steps = [np.hypot(*poses[:, :2].T), turns, np.hypot(*anchors.T)]
        return float(np.max(np.concatenate([*steps, np.abs(other.offsets - self.offsets)[-1:]])))


@dataclass(frozen=True, slots=True, eq=False)
class Indices:
    """Positions in the problem: what GTSAM's keys are made of."""

    stations: dict[StationId, int]
    anchors: dict[AnchorId, int]

    @classmethod
    def of(cls, problem: GraphProblem) -> Indices:
        """Those of a problem."""
        return cls(
            {station.id: index for index, station in enumerate(problem.stations)},
            {anchor.id: index for index, anchor in enumerate(problem.anchors)},
        )

    def name(self, symbol: str) -> str:
        """What a person calls the variable that GTSAM calls `x3` or `l0`."""
        kind, index = symbol[0], int(symbol[1:])
        if kind == "b":
            return "the range offset"
        if kind == "d":
            return f"the delay of anchor {list(self.anchors)[index]}"
        if kind == "x":
            return f"station {list(self.stations)[index]}"
        return f"anchor {list(self.anchors)[index]}"


def to_values(variables: Variables, indices: Indices, with_offset: bool) -> gtsam.Values:
    """GTSAM's values of the variables."""
    values = gtsam.Values()
    for station, pose in variables.poses.items():
        values.insert(factors.X(indices.stations[station]), factors.to_gtsam(pose))
    for anchor, place in variables.anchors.items():
        values.insert(factors.L(indices.anchors[anchor]), np.asarray(place))
    if with_offset:
        values.insert(factors.OFFSET_KEY, variables.offset)
        for anchor in variables.anchors:
            values.insert(factors.D(indices.anchors[anchor]), variables.offset_of(anchor))
    return values


def from_values(values: gtsam.Values, like: Variables, indices: Indices) -> Variables:
    """The variables of GTSAM's values, in the order of `like`."""
    anchors: dict[AnchorId, Vector2] = {
        name: values.atPoint2(factors.L(indices.anchors[name])) for name in like.anchors
    }
    poses = {
        n: factors.from_gtsam(values.atPose2(factors.X(indices.stations[n]))) for n in like.poses
    }
    if not values.exists(factors.OFFSET_KEY):
        return Variables(poses, anchors, like.offset)
    offset = values.atDouble(factors.OFFSET_KEY)
    delays = {n: values.atDouble(factors.D(indices.anchors[n])) - offset for n in anchors}
    return Variables(poses, anchors, offset, delays)


def movement(before: Variables, after: Variables) -> float:
    """Largest change of anything; a radian counts as a metre."""
    poses = [
        max(pose.distance_to(after.poses[name]), pose.angle_to(after.poses[name]))
        for name, pose in before.poses.items()
    ]
    anchors = [math.dist(place, after.anchors[name]) for name, place in before.anchors.items()]
    return max([*poses, *anchors, abs(before.offset - after.offset)])
