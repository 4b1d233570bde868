"""A small solution with one of everything that a report has to say."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slam_uwb.model.floor import FloorMap
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement, ScanMatch
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import (
    Alternative,
    AnchorEstimate,
    Bias,
    Solution,
    SolverChecks,
    StationEstimate,
    Status,
)

OCCUPANCY = np.full((8, 10), np.nan)
OCCUPANCY[1:7, 1:9] = 0.99
OCCUPANCY[2:6, 2:8] = 0.05

STATIONS = tuple(
    StationEstimate(name, Pose2(*pose), np.diag([4e-4, 1e-4, 1e-4]), Status.OK)
    for name, pose in {
        "s1": (0.0, 0.0, 0.0), "s2": (3.0, 0.0, math.pi / 2), "s10": (3.0, 2.0, math.pi),
        "s4": (0.0, 2.0, 0.5),
    }.items()
)  # fmt: skip
ANCHORS = (
    AnchorEstimate("A", np.array([1.0, 1.0]), np.diag([0.0025, 0.01]), 2.0, 4, Status.OK),
    AnchorEstimate("B", np.array([4.0, 1.0]), np.diag([0.0025, 0.0025]), 2.5, 4, Status.OK),
    AnchorEstimate("C", np.array([-1.0, 1.0]), np.diag([0.0025, 0.0025]), 2.0, 4, Status.OK),
)


def link(station: str, anchor: str, residual: float = 0.01, **more: Any) -> LinkMeasurement:
    values: dict[str, Any] = {"walls": 0.1, "nlos_probability": 0.05, **more}
    return LinkMeasurement(station, anchor, 2.0, 2.0, 0.1, 60, residual=residual, **values)  # type: ignore[arg-type]


LINKS = tuple(link(s.id, a.id) for s in STATIONS for a in ANCHORS)
MATCHES = (
    ScanMatch("s1", "s2", STATIONS[1].pose, np.diag([1e-6, 9e-4, 1e-6]), 0.5, 0.01, 9.0, 0),
    ScanMatch("s1", "s2", Pose2(1.0, 5.0, 0.0), np.eye(3) * 1e-4, 0.2, 0.1, 2.0, 1,
              rejection="another hypothesis of the pair is used"),
)  # fmt: skip

BASE = Solution(
    survey_name="room", checksum="ab12", mode="joint", settings=Settings(), software_version="1.2.3",
    frame="s1", stations=STATIONS, anchors=ANCHORS, matches=MATCHES, links=LINKS,
    biases=(Bias("range offset", 0.19, 0.02, 0.18, 0.1),), joint_names=(), joint_covariance=None,
    checks=SolverChecks(1e-6, 0.0, 4, 12.5), floor_map=FloorMap(OCCUPANCY, 0.5, (-0.5, -1.0)), scans={},
)  # fmt: skip


@pytest.fixture
def make_solution() -> Callable[..., Solution]:
    """The small solution, with what differs."""

    def make(**changes: Any) -> Solution:
        return replace(BASE, **changes)

    return make


@pytest.fixture
def make_link() -> Callable[..., LinkMeasurement]:
    return link


@pytest.fixture
def mirrored() -> AnchorEstimate:
    """An anchor with two places."""
    return AnchorEstimate(
        "B", np.array([4.0, 1.0]), np.diag([0.01, 0.01]), 2.0, 3, Status.MIRROR_AMBIGUOUS,
        (Alternative(4.0, 3.0, None, 0.4),),
    )  # fmt: skip
