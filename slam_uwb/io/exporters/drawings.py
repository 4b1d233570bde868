"""The floor plan with stations and anchors for CAD, GIS and documents: DXF, GeoJSON, SVG; metres."""

from __future__ import annotations

import io
import json
import math
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ...model.geometry import FloatArray
from ...model.solution import Solution

LAYERS = {"WALLS": 7, "DOORS": 30, "ROOMS": 140, "ANCHORS": 1, "STATIONS": 5}
"""Name -> AutoCAD colour index."""
_MARK_M = 0.12
_TEXT_M = 0.2


def dxf_plan(solution: Solution) -> dict[str, bytes]:
    """floor.dxf: R2010, metres in its header, one layer a kind of thing; the same bytes every time."""
    import ezdxf
    from ezdxf import units
    from ezdxf.filemanagement import new

    # Documented, though not marked as exported.
    options = ezdxf.options  # type: ignore[attr-defined]
    with_meta = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True  # no date, no random identifiers
    try:
        document = new("R2010", units=units.M)
        for name, colour in LAYERS.items():
            document.layers.add(name, color=colour)
        _draw_dxf(document.modelspace(), solution)
        # The library declares them in the order of a set, which differs from process to process.
        for dxf_type in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(dxf_type)
        stream = io.StringIO()
        document.write(stream)
    finally:
        options.write_fixed_meta_data_for_testing = with_meta
    return {"floor.dxf": stream.getvalue().encode("utf-8")}


def _draw_dxf(space: Any, solution: Solution) -> None:
    plan = solution.plan
    for room in plan.rooms if plan else ():
        space.add_lwpolyline(room.polygon.tolist(), close=True, dxfattribs={"layer": "ROOMS"})
    for wall in plan.walls if plan else ():
        layer = {"layer": "WALLS"}
        if math.isfinite(wall.thickness):
            space.add_lwpolyline(_outline(wall.ends, wall.thickness), close=True, dxfattribs=layer)
        else:
            space.add_line(*wall.ends.tolist(), dxfattribs=layer)
    for door in plan.doors if plan else ():
        space.add_line(*door.tolist(), dxfattribs={"layer": "DOORS"})
    for layer_name, name, place, height in _places(solution):
        attributes = {"layer": layer_name}
        space.add_circle((*place, height), _MARK_M, dxfattribs=attributes)
        text = space.add_text(name, height=_TEXT_M, dxfattribs=attributes)
        text.set_placement((place[0] + _MARK_M, place[1] + _MARK_M))


def _outline(ends: FloatArray, thickness: float) -> list[list[float]]:
    """Corners of a wall of that thickness round its centre line."""
    way = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
    aside = 0.5 * thickness * np.array([-way[1], way[0]])
    corners: list[list[float]] = np.array(
        [ends[0] - aside, ends[1] - aside, ends[1] + aside, ends[0] + aside]
    ).tolist()
    return corners


def _places(solution: Solution) -> list[tuple[str, str, tuple[float, float], float]]:
    """Layer, name, place and height, m, of what has a place."""
    found = [
        ("STATIONS", str(s.id), (s.pose.x, s.pose.y), 0.0) for s in solution.stations if s.pose
    ]
    for anchor in solution.anchors:
        if anchor.position is not None:
            x, y = anchor.position.tolist()
            found.append(("ANCHORS", str(anchor.id), (x, y), float(anchor.height or 0.0)))
    return found


def geojson_plan(solution: Solution) -> dict[str, bytes]:
    """floor.geojson: coordinates are metres of the solution's frame, not degrees (no `crs` is named)."""
    features = []
    plan = solution.plan
    for number, room in enumerate(plan.rooms if plan else (), 1):
        ring = [*room.polygon.tolist(), room.polygon[0].tolist()]
        features.append(_feature("Polygon", [ring], "room", number, area_m2=round(room.area, 3)))
    for number, wall in enumerate(plan.walls if plan else (), 1):
        thickness = round(wall.thickness, 3) if math.isfinite(wall.thickness) else None
        features.append(
            _feature("LineString", wall.ends.tolist(), "wall", number, thickness_m=thickness)
        )
    for number, door in enumerate(plan.doors if plan else (), 1):
        features.append(_feature("LineString", door.tolist(), "door", number))
    for station in solution.stations:
        if station.pose is not None:
            at, status = [station.pose.x, station.pose.y], station.status.value
            features.append(_feature("Point", at, "station", station.id, status=status))
    for anchor in solution.anchors:
        if anchor.position is not None:
            at, more = anchor.position.tolist(), {"height_m": anchor.height}
            status = anchor.status.value
            features.append(_feature("Point", at, "anchor", anchor.id, status=status, **more))
    content = {"type": "FeatureCollection", "frame": solution.frame, "features": features}
    return {"floor.geojson": (json.dumps(content, allow_nan=False) + "\n").encode()}


def _feature(
    shape: str, coordinates: Any, kind: str, name: object, **more: object
) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": {"kind": kind, "id": name, **more},
    }


def svg_plan(solution: Solution) -> dict[str, bytes]:
    """floor.svg: the plan in metres, a page that is as large as the floor at a scale of 1:100."""
    corners = [np.array(place) for _, _, place, _ in _places(solution)]
    plan = solution.plan
    for room in plan.rooms if plan else ():
        corners.extend(room.polygon)
    for wall in plan.walls if plan else ():
        corners.extend(wall.ends)
    low, high = (
        (np.min(corners, axis=0) - 1.0, np.max(corners, axis=0) + 1.0)
        if corners
        else (np.zeros(2), np.ones(2))
    )
    width, height = (high - low).tolist()
    size = f'width="{width:.2f}cm" height="{height:.2f}cm"'
    view = f'viewBox="{low[0]:.3f} {-high[1]:.3f} {width:.3f} {height:.3f}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {view}>',
        f"<title>{escape(solution.survey_name)}</title>",
        *_svg_plan_lines(solution),
        *_svg_marks(solution),
        "</svg>",
    ]
    return {"floor.svg": ("\n".join(lines) + "\n").encode()}


def _svg_plan_lines(solution: Solution) -> list[str]:
    plan = solution.plan
    if plan is None:
        return []
    rooms = [f'<path d="{_svg_path(room.polygon)}Z"/>' for room in plan.rooms]
    walls = [
        f'<path d="{_svg_path(wall.ends)}" stroke-width='
        f'"{wall.thickness if math.isfinite(wall.thickness) else 0.03:.3f}"/>'
        for wall in plan.walls
    ]
    doors = [f'<path d="{_svg_path(door)}"/>' for door in plan.doors]
    return [
        '<g id="ROOMS" fill="#56b4e9" fill-opacity="0.15">', *rooms, "</g>",
        '<g id="WALLS" fill="none" stroke="#222222">', *walls, "</g>",
        '<g id="DOORS" fill="none" stroke="#e69f00" stroke-width="0.04">', *doors, "</g>",
    ]  # fmt: skip


def _svg_marks(solution: Solution) -> list[str]:
    groups: dict[str, list[str]] = {"STATIONS": [], "ANCHORS": []}
    for layer, name, (x, y), _ in _places(solution):
        groups[layer].append(
            f'<circle id={quoteattr(f"{layer}-{name}")} cx="{x:.4f}" cy="{-y:.4f}" r="{_MARK_M}"/>'
            f'<text x="{x + _MARK_M:.3f}" y="{-y - _MARK_M:.3f}" font-size="{_TEXT_M}">'
            f"{escape(name)}</text>"
        )
    colours = {"STATIONS": "#0072b2", "ANCHORS": "#d55e00"}
    return [
        line
        for layer, marks in groups.items()
        for line in (f'<g id="{layer}" fill="{colours[layer]}">', *marks, "</g>")
    ]


def _svg_path(places: FloatArray) -> str:
    return "M" + "L".join(f"{x:.4f} {-y + 0.0:.4f}" for x, y in places.tolist())
