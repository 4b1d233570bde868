"""The CSV files of a solution folder: metres, degrees, empty cells where nothing is known.

Covariances of a station are kept in the station's own axes; stations.csv gives sigmas along the
world's axes, so they are rotated here. matches.csv gives them in n's axes, as they are kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..model.geometry import Matrix3, rotation_matrix
from ..model.products import LinkMeasurement, ScanMatch
from ..model.solution import Alternative, AnchorEstimate, Solution, StationEstimate
from .csv_text import Cell, number, table

_PLACE_DECIMALS = 4
_SIGMA_DECIMALS = 6
_ANGLE_DECIMALS = 4


def solution_tables(solution: Solution) -> dict[str, bytes]:
    """anchors.csv, stations.csv, alternatives.csv, links.csv and matches.csv."""
    return {
        "anchors.csv": table(
            (
                "anchor", "x_m", "y_m", "z_m", "sigma_x_m", "sigma_y_m", "cov_xy_m2", "stations",
                "status",
            ),
            map(_anchor, solution.anchors),
        ),
        "stations.csv": table(
            (
                "station", "x_m", "y_m", "yaw_deg", "sigma_x_m", "sigma_y_m", "sigma_yaw_deg",
                "status",
            ),
            map(_station, solution.stations),
        ),
        "alternatives.csv": table(
            ("kind", "id", "rank", "x_m", "y_m", "yaw_deg", "weight"), _alternatives(solution)
        ),
        "links.csv": table(
            (
                "station", "anchor", "samples", "range_m", "sigma_m", "residual_m", "walls",
                "nlos_probability", "used", "reason",
            ),
            map(_link, solution.links),
        ),
        "matches.csv": table(
            (
                "station_m", "station_n", "rank", "dx_m", "dy_m", "dyaw_deg", "sigma_x_m",
                "sigma_y_m", "sigma_yaw_deg", "overlap", "violation", "used", "reason",
            ),
            map(_match, solution.matches),
        ),
    }  # fmt: skip


def _metres(value: float | None) -> str:
    return number(value, _PLACE_DECIMALS)


def _degrees(value: float | None) -> str:
    return "" if value is None else number(math.degrees(value), _ANGLE_DECIMALS)


def _sigma(variance: float) -> str:
    # A variance below zero is rounding of a direction that is fixed.
    return number(math.sqrt(max(variance, 0.0)), _SIGMA_DECIMALS) if variance == variance else ""


def _sigma_degrees(variance: float) -> str:
    return number(math.degrees(math.sqrt(max(variance, 0.0))), _SIGMA_DECIMALS)


def _anchor(item: AnchorEstimate) -> list[Cell]:
    place = ["", ""] if item.position is None else [_metres(v) for v in item.position.tolist()]
    spread = ["", "", ""]
    if item.position is not None and item.covariance is not None:
        (xx, xy), (_, yy) = item.covariance.tolist()
        spread = [_sigma(xx), _sigma(yy), number(xy, 8)]
    return [item.id, *place, _metres(item.height), *spread, item.stations, item.status.value]


def _station(item: StationEstimate) -> list[Cell]:
    if item.pose is None:
        return [item.id, *[""] * 6, item.status.value]
    yaw = _degrees(item.pose.theta) if item.heading_known else ""
    spread = ["", "", ""]
    if item.covariance is not None:
        spread = _world_sigmas(item.covariance, item.pose.theta)
        spread[2] = spread[2] if item.heading_known else ""
    return [item.id, _metres(item.pose.x), _metres(item.pose.y), yaw, *spread, item.status.value]


def _world_sigmas(covariance: Matrix3, theta: float) -> list[str]:
    """Sigmas along the world's x and y (m) and of yaw (degrees) of a covariance in own axes."""
    rotation = rotation_matrix(theta)
    xx, yy = np.diag(rotation @ covariance[:2, :2] @ rotation.T).tolist()
    return [_sigma(xx), _sigma(yy), _sigma_degrees(float(covariance[2, 2]))]


def _alternatives(solution: Solution) -> Iterable[list[Cell]]:
    """Rank 1 is the likeliest of an item's other places."""
    for station in solution.stations:
        yield from _places("station", station.id, station.alternatives)
    for anchor in solution.anchors:
        yield from _places("anchor", anchor.id, anchor.alternatives)


def _places(kind: str, name: str, items: Iterable[Alternative]) -> Iterable[list[Cell]]:
    for rank, item in enumerate(items, 1):
        place = [_metres(item.x), _metres(item.y), _degrees(item.theta)]
        yield [kind, name, rank, *place, number(item.weight, 4)]


def _link(item: LinkMeasurement) -> list[Cell]:
    return [
        item.station,
        item.anchor,
        int(item.samples),
        _metres(item.distance),
        number(item.sigma, _SIGMA_DECIMALS),
        _metres(item.residual),
        number(item.walls, 3),
        number(item.nlos_probability, 4),
        item.rejection is None,
        item.rejection or "",
    ]


def _match(item: ScanMatch) -> list[Cell]:
    pose = item.target_T_source
    xx, yy, tt = np.diag(item.covariance).tolist()
    return [
        item.target,
        item.source,
        int(item.rank),
        _metres(pose.x),
        _metres(pose.y),
        _degrees(pose.theta),
        _sigma(xx),
        _sigma(yy),
        _sigma_degrees(tt),
        number(item.overlap, 4),
        number(item.violation, 4),
        item.rejection is None,
        item.rejection or "",
    ]
