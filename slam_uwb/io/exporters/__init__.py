"""A solution in the formats of other tools; each exporter is a function of the solution alone."""

from .anchors import anchors_bitcraze, anchors_csv, anchors_dwm1001, anchors_json, anchors_pozyx
from .clouds import pcd_cloud, ply_cloud
from .drawings import dxf_plan, geojson_plan, svg_plan
from .formats import ANCHOR_EXPORTERS, EXPORTERS, Exporter, export_solution
from .graphs import g2o_graph, pyfg_graph, tum_stations

__all__ = [
    "ANCHOR_EXPORTERS",
    "EXPORTERS",
    "Exporter",
    "anchors_bitcraze",
    "anchors_csv",
    "anchors_dwm1001",
    "anchors_json",
    "anchors_pozyx",
    "dxf_plan",
    "export_solution",
    "g2o_graph",
    "geojson_plan",
    "pcd_cloud",
    "ply_cloud",
    "pyfg_graph",
    "svg_plan",
    "tum_stations",
]
