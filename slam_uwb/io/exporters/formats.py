"""Name of a format -> what writes it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ...model.errors import SlamUwbError
from ...model.solution import Solution
from ..floor_map_files import pgm_map
from .anchors import anchors_bitcraze, anchors_csv, anchors_dwm1001, anchors_json, anchors_pozyx
from .clouds import pcd_cloud, ply_cloud
from .drawings import dxf_plan, geojson_plan, svg_plan
from .graphs import g2o_graph, pyfg_graph, tum_stations

Exporter = Callable[[Solution], dict[str, bytes]]
"""Solution -> name and content of the files."""


def ros_map_server(solution: Solution) -> dict[str, bytes]:
    """map.pgm and map.yaml as the ROS map_server reads them."""
    if solution.floor_map is None or not solution.floor_map.occupancy.size:
        raise SlamUwbError("ros: the solution has no map")
    picture, yaml = pgm_map(solution.floor_map)
    return {"map.pgm": picture, "map.yaml": yaml}


ANCHOR_EXPORTERS: dict[str, Exporter] = {
    "bitcraze": anchors_bitcraze,
    "csv": anchors_csv,
    "dwm1001": anchors_dwm1001,
    "json": anchors_json,
    "pozyx": anchors_pozyx,
}
"""For positioning systems, which get trusted anchors only."""
EXPORTERS: dict[str, Exporter] = {
    **ANCHOR_EXPORTERS,
    "dxf": dxf_plan,
    "g2o": g2o_graph,
    "geojson": geojson_plan,
    "pcd": pcd_cloud,
    "ply": ply_cloud,
    "pyfg": pyfg_graph,
    "ros": ros_map_server,
    "svg": svg_plan,
    "tum": tum_stations,
}


def export_solution(solution: Solution, formats: Iterable[str]) -> dict[str, bytes]:
    """All files of the formats.

    Raises:
        SlamUwbError: a format does not exist, or the solution lacks what it needs.
    """
    files: dict[str, bytes] = {}
    for name in formats:
        if name not in EXPORTERS:
            raise SlamUwbError(
                f"--to {name}: no such format; there are {', '.join(sorted(EXPORTERS))}"
            )
        files |= EXPORTERS[name](solution)
    return files
