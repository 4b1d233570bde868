"""The scans' points in the world frame, as PLY and PCD; z is zero, since scans are flat."""

from __future__ import annotations

import numpy as np

from ...model.geometry import Points
from ...model.solution import Solution


def world_points(solution: Solution) -> Points:
    """(N, 2) m, the points of all placed scans, station by station."""
    parts = [np.empty((0, 2))]
    for station in solution.stations:
        scan = solution.scans.get(station.id)
        if scan is None or station.pose is None:
            continue
        seen = np.isfinite(scan.ranges)
        bearings, ranges = scan.bearings[seen], scan.ranges[seen]
        flat = ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
        parts.append(station.pose.transform(flat))
    return np.concatenate(parts)


def ply_cloud(solution: Solution) -> dict[str, bytes]:
    """cloud.ply: binary little-endian, float x, y, z."""
    points = _flat(solution)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return {"cloud.ply": header.encode() + points.tobytes()}


def pcd_cloud(solution: Solution) -> dict[str, bytes]:
    """cloud.pcd, version 0.7: binary, float x, y, z."""
    points = _flat(solution)
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n"
        f"TYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\nDATA binary\n"
    )
    return {"cloud.pcd": header.encode() + points.tobytes()}


def _flat(solution: Solution) -> np.ndarray:
    points = world_points(solution)
    return np.column_stack([points, np.zeros(len(points))]).astype("<f4")
