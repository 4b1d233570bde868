"""The problem and its solution as pose graphs, and the stations as a trajectory."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ...model.products import LinkMeasurement
from ...model.solution import Solution
from ..csv_text import table
from ..tum import poses_to_tum


def g2o_graph(solution: Solution) -> dict[str, bytes]:
    """graph.g2o: poses, used matches, anchors as VERTEX_XY; ranges as in PyFactorGraph, which g2o skips.

    Information matrices are the inverse of the matches' covariances, order x, y, theta.
    """
    poses, anchors = _numbers(solution)
    lines = [f"VERTEX_SE2 {poses[s.id]} {_row(s.pose.vector)}" for s in solution.stations if s.pose]
    lines += [
        f"VERTEX_XY {len(poses) + anchors[a.id]} {_row(a.position)}"
        for a in solution.anchors
        if a.position is not None
    ]
    for match in solution.matches:
        if match.rejection is None and {match.target, match.source} <= poses.keys():
            ends = f"{poses[match.target]} {poses[match.source]}"
            information = np.linalg.inv(match.covariance)
            pose = _row(match.target_T_source.vector)
            lines.append(f"EDGE_SE2 {ends} {pose} {_row(information[np.triu_indices(3)])}")
    for link, distance, variance in _flat_ranges(solution):
        ends = f"{poses[link.station]} {len(poses) + anchors[link.anchor]}"
        lines.append(f"EDGE_RANGE {ends} {distance:.6f} {1.0 / variance:.6f}")
    return {"graph.g2o": _text(lines), "graph_names.csv": _names(poses, anchors)}


def pyfg_graph(solution: Solution) -> dict[str, bytes]:
    """graph.pyfg: PyFactorGraph's text, poses A0, A1, ... and anchors L0, L1, ...; `t` is the pose's number.

    Ranges are horizontal, without the offset: what a planar solver takes. graph_names.csv says which
    station and anchor each is.
    """
    poses, anchors = _numbers(solution)
    lines = [
        f"VERTEX_SE2 {poses[s.id]:.9f} A{poses[s.id]} {_row(s.pose.vector)}"
        for s in solution.stations
        if s.pose
    ]
    lines += [
        f"VERTEX_XY L{anchors[a.id]} {_row(a.position)}"
        for a in solution.anchors
        if a.position is not None
    ]
    for match in solution.matches:
        if match.rejection is None and {match.target, match.source} <= poses.keys():
            ends = f"A{poses[match.target]} A{poses[match.source]}"
            pose = _row(match.target_T_source.vector)
            noise = _row(match.covariance[np.triu_indices(3)])
            lines.append(f"EDGE_SE2 {poses[match.source]:.9f} {ends} {pose} {noise}")
    for link, distance, variance in _flat_ranges(solution):
        ends = f"A{poses[link.station]} L{anchors[link.anchor]}"
        time = f"{poses[link.station]:.9f}"
        lines.append(f"EDGE_RANGE {time} {ends} {distance:.6f} {variance:.9f}")
    return {"graph.pyfg": _text(lines), "graph_names.csv": _names(poses, anchors)}


def tum_stations(solution: Solution) -> dict[str, bytes]:
    """stations.tum: the stations whose pose is known, whatever their status, by their numbers."""
    poses = {
        number: station.pose
        for number, station in enumerate(solution.stations)
        if station.pose is not None and station.heading_known
    }
    return {"stations.tum": poses_to_tum(poses).encode()}


def _numbers(solution: Solution) -> tuple[dict[str, int], dict[str, int]]:
    """Placed stations and anchors, numbered in the solution's order."""
    stations = [s.id for s in solution.stations if s.pose is not None]
    anchors = [a.id for a in solution.anchors if a.position is not None]
    return (
        {str(name): number for number, name in enumerate(stations)},
        {str(name): number for number, name in enumerate(anchors)},
    )


def _flat_ranges(solution: Solution) -> Iterator[tuple[LinkMeasurement, float, float]]:
    """Used links with their horizontal distance, m, and its variance, m^2."""
    poses, anchors = _numbers(solution)
    heights = {a.id: a.height for a in solution.anchors}
    offset = next((b.mean for b in solution.biases if b.name == "range offset"), 0.0)
    for link in solution.links:
        height, tag = heights.get(link.anchor), solution.tag_heights.get(link.station)
        if link.rejection is not None or height is None or tag is None:
            continue
        if link.station not in poses or link.anchor not in anchors:
            continue
        slant = link.distance - offset
        flat = math.sqrt(max(slant**2 - (height - tag) ** 2, 0.0))
        # A range straight up says nothing of where the anchor is.
        if flat > 0.0:
            yield link, flat, (link.sigma * slant / flat) ** 2


def _row(values: ArrayLike) -> str:
    return " ".join(f"{value + 0.0:.9g}" for value in np.asarray(values).tolist())


def _names(poses: dict[str, int], anchors: dict[str, int]) -> bytes:
    rows: list[list[str | int]] = [["station", f"A{k}", k, name] for name, k in poses.items()]
    rows += [["anchor", f"L{k}", len(poses) + k, name] for name, k in anchors.items()]
    return table(("kind", "pyfg", "g2o", "id"), rows)


def _text(lines: list[str]) -> bytes:
    return "".join(f"{line}\n" for line in lines).encode()
