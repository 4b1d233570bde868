"""What the map of the report shows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..evaluate.estimates import Estimate, anchor_estimates, station_estimates
from ..model.floor import FloorMap
from ..model.geometry import FloatArray
from ..model.products import LinkMeasurement
from ..model.solution import Solution, Status
from ..planning import Suggestion
from .page_shapes import (
    UNITS_A_METRE,
    Line,
    Mark,
    Oval,
    Picture,
    Shape,
    door_shapes,
    draw_floor,
    draw_given,
    room_shapes,
    to_picture,
    wall_shapes,
)
from .trust import SIGMAS, AnchorJudgement, Trust

_MARGIN_M = 0.8
_PIXELS = 900.0
"""Width that marks are sized for where no script tells the true one."""
_NAME_PIXELS = np.array([20.0, -10.0])
"""From a mark to the middle of a short name beside it."""


@dataclass(frozen=True, slots=True)
class PageMap:
    """Everything that the map shows."""

    view: tuple[float, float, float, float]
    """x, y, width, height of what is seen at first."""
    unit: float
    """Picture units a pixel, where no script tells."""
    picture: Picture | None
    given: Picture | None
    """That the frame was aligned to."""
    rooms: tuple[Shape, ...]
    walls: tuple[Shape, ...]
    doors: tuple[Shape, ...]
    stations: tuple[Mark, ...]
    anchors: tuple[Mark, ...]
    others: tuple[Mark, ...]
    ovals: tuple[Oval, ...]
    links: tuple[Line, ...]
    matches: tuple[Line, ...]
    places: tuple[Mark, ...]
    """Where to measure next."""


def build_page_map(
    solution: Solution,
    anchors: Sequence[AnchorJudgement],
    places_to_measure: Sequence[Suggestion] = (),
) -> PageMap:
    """The map's content; empty layers where a solution has nothing for them."""
    stations, places = station_estimates(solution), anchor_estimates(solution)
    view = _view(solution.floor_map, [*stations, *places])
    unit = max(view[2], view[3]) / _PIXELS
    station_marks = tuple(_station_mark(item) for item in stations if item.position is not None)
    anchor_marks = tuple(
        _anchor_mark(item, judged)
        for item, judged in zip(places, anchors, strict=True)
        if item.position is not None
    )
    suggested = tuple(_suggested(places_to_measure))
    taken = _taken([*station_marks, *anchor_marks, *suggested], unit)
    return PageMap(
        view=view,
        unit=unit,
        picture=None if solution.floor_map is None else draw_floor(solution.floor_map),
        given=None if solution.picture is None else draw_given(solution.picture),
        rooms=tuple(room_shapes(solution.plan, taken)),
        walls=tuple(wall_shapes(solution.plan)),
        doors=tuple(door_shapes(solution.plan)),
        stations=station_marks,
        anchors=anchor_marks,
        others=tuple(_other_marks(stations, "station")) + tuple(_other_marks(places, "anchor")),
        ovals=tuple(_ovals(stations, "station")) + tuple(_ovals(places, "anchor")),
        links=tuple(_links(solution, places)),
        matches=tuple(_matches(solution, stations)),
        places=suggested,
    )


def _taken(marks: Sequence[Mark], unit: float) -> FloatArray:
    """(2 M, 2) m of the marks, and of their names, which stand to their upper right."""
    signs = np.array([[mark.x, mark.y] for mark in marks]).reshape(-1, 2)
    names = signs + unit * _NAME_PIXELS
    return np.concatenate([signs, names]) * [1.0, -1.0] / UNITS_A_METRE


def _view(
    floor_map: FloorMap | None, items: Sequence[Estimate]
) -> tuple[float, float, float, float]:
    """What is sure fills the map; an anchor hundreds of metres off must not shrink it to a dot."""
    sure = [i.position for i in items if i.position is not None and i.status is Status.OK]
    corners = [*sure, *(() if floor_map is None else floor_map.seen_corners)]
    corners = corners or [i.position for i in items if i.position is not None] or [np.zeros(2)]
    low, high = np.min(corners, axis=0) - _MARGIN_M, np.max(corners, axis=0) + _MARGIN_M
    x, y = to_picture(np.array([low[0], high[1]]))
    width, height = (high - low) * UNITS_A_METRE
    return x, y, round(float(width), 2), round(float(height), 2)


def _station_mark(item: Estimate) -> Mark:
    assert item.position is not None  # noqa: S101 - chosen by the caller
    x, y = to_picture(item.position)
    known = math.isfinite(item.heading)
    return Mark(
        key=f"station:{item.id}",
        x=x,
        y=y,
        kind="station" if item.status is Status.OK else "station doubtful",
        tip=_tip(f"station {item.id}", item),
        name=item.id,
        turn=round(-math.degrees(item.heading), 2) if known else None,
    )


def _anchor_mark(item: Estimate, judged: AnchorJudgement) -> Mark:
    assert item.position is not None  # noqa: S101 - chosen by the caller
    x, y = to_picture(item.position)
    lines = [
        _tip(f"anchor {item.id}", item),
        f"links: {len(judged.used)} used, {len(judged.rejected)} rejected",
        judged.trust.value + (f": {'; '.join(judged.why)}" if judged.why else ""),
    ]
    kind = "anchor" if judged.trust is Trust.YES else "anchor doubtful"
    return Mark(f"anchor:{item.id}", x, y, kind, "\n".join(lines), item.id)


def _suggested(suggestions: Sequence[Suggestion]) -> Iterable[Mark]:
    for rank, item in enumerate(suggestions, 1):
        x, y = to_picture(item.place)
        tip = (
            f"measure here next ({rank})\nx {item.place[0]:.2f} m, y {item.place[1]:.2f} m\n"
            f"anchors from {item.before:.2f} m to {item.after:.2f} m"
        )
        yield Mark(f"plan:{rank}", x, y, "plan", tip, f"next {rank}")


def _tip(title: str, item: Estimate) -> str:
    assert item.position is not None  # noqa: S101 - chosen by the caller
    lines = [title, f"x {item.position[0]:.2f} m, y {item.position[1]:.2f} m"]
    if math.isfinite(item.heading):
        lines[-1] += f", heading {math.degrees(item.heading):.1f}°"
    if item.covariance is not None and np.isfinite(item.covariance[:2, :2]).all():
        long, short = _axes(item.covariance)[0]
        lines.append(f"2 sigma {long:.3f} m by {short:.3f} m")
    if item.status is not Status.OK:
        lines.append(str(item.status.value))
    return "\n".join(lines)


def _other_marks(items: Iterable[Estimate], kind: str) -> Iterable[Mark]:
    for item in items:
        for place in item.alternatives:
            x, y = to_picture(place)
            tip = f"{kind} {item.id}: another place that is not excluded"
            yield Mark(f"{kind}:{item.id}", x, y, f"other {kind}", tip, f"{item.id}?")


def _axes(covariance: FloatArray) -> tuple[tuple[float, float], float]:
    """Half axes of two sigmas (long, short), m, and the long one's direction, rad."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    short, long = SIGMAS * np.sqrt(np.maximum(values, 0.0))
    return (float(long), float(short)), math.atan2(vectors[1, 1], vectors[0, 1])


def _ovals(items: Iterable[Estimate], kind: str) -> Iterable[Oval]:
    for item in items:
        if item.position is None or item.covariance is None:
            continue
        if not np.isfinite(item.covariance[:2, :2]).all():
            continue
        (long, short), direction = _axes(item.covariance)
        x, y = to_picture(item.position)
        long, short = (round(v * UNITS_A_METRE, 2) for v in (long, short))
        yield Oval(kind, x, y, long, short, round(-math.degrees(direction), 2))


def _links(solution: Solution, anchors: Sequence[Estimate]) -> Iterable[Line]:
    tags = {
        s.id: s.pose.transform(np.array(solution.tag_offset)) for s in solution.stations if s.pose
    }
    places = {item.id: item.position for item in anchors if item.position is not None}
    for link in solution.links:
        if link.station not in tags or link.anchor not in places:
            continue
        ends = *to_picture(tags[link.station]), *to_picture(places[link.anchor])
        keys = f"station:{link.station} anchor:{link.anchor}"
        yield Line(keys, link_kind(link), *ends, tip=_link_tip(link))


def link_kind(link: LinkMeasurement) -> str:
    """CSS class of a link: `rejected`, `blocked` where it more likely crosses a wall, else `free`."""
    if link.rejection is not None:
        return "rejected"
    return "blocked" if link.nlos_probability > 0.5 else "free"


def _link_tip(link: LinkMeasurement) -> str:
    lines = [f"link {link.station} to {link.anchor}: {link.distance:.2f} m"]
    if math.isfinite(link.residual):
        lines.append(f"residual {link.residual:+.3f} m")
    if math.isfinite(link.walls):
        lines.append(f"walls {link.walls:.1f}")
    return "\n".join([*lines, link.rejection or "used"])


def _matches(solution: Solution, stations: Sequence[Estimate]) -> Iterable[Line]:
    places = {item.id: item.position for item in stations if item.position is not None}
    for match in solution.matches:
        if match.rejection is not None or not {match.target, match.source} <= places.keys():
            continue
        ends = *to_picture(places[match.target]), *to_picture(places[match.source])
        tip = f"match {match.target}, {match.source}\noverlap {100 * match.overlap:.0f} %"
        keys = f"station:{match.target} station:{match.source}"
        yield Line(keys, "degenerate" if match.degenerate else "firm", *ends, tip=tip)
