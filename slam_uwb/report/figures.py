"""One picture of a solution, in the manner of the paper's Fig. 5a.

Floor map in greys, stations, anchors with their ellipses; where ground truth is at hand, how far off
the anchors are. Drawn on `Figure` alone, never on pyplot: no window, no global state.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..evaluate import Evaluation, evaluate_solution
from ..evaluate.estimates import Estimate, anchor_estimates, station_estimates
from ..model.floor import FloorMap
from ..model.geometry import Points
from ..model.solution import Solution, Status
from ..model.survey import Reference
from .labels import Label, place_labels
from .marks import (
    ANCHOR,
    STATION,
    draw_alternatives,
    draw_ellipses,
    draw_headings,
    draw_places,
    draw_reference,
    heading_ticks,
)

_UNKNOWN, _FREE, _OCCUPIED = 0.86, 1.0, 0.12
_LONG_SIDE_IN, _MIN_WIDTH_IN, _MIN_HEIGHT_IN = 9.0, 5.0, 1.8
_MANY_STATIONS, _TOO_MANY_STATIONS = 60, 250


def draw_solution(
    solution: Solution, *, reference: Reference | None = None, evaluation: Evaluation | None = None
) -> Figure:
    """Draw the floor map, stations and anchors of a solution in the world frame.

    Headings are ticks, ellipses hold two sigmas. What is not `ok` is hollow or half filled, with its
    status in the legend; what has no place is named below. With a reference the true places of the
    anchors are crosses, brought into the world by the inverse of the evaluation's alignment.

    Args:
        solution: What to draw; any part of it may be missing.
        reference: Ground truth.
        evaluation: Of this solution against this reference; made here where it is not given.

    Returns:
        A figure with an Agg canvas, for `figure_png` or `figure.savefig`.
    """
    if evaluation is None and reference is not None:
        evaluation = evaluate_solution(solution, reference)
    stations, anchors = station_estimates(solution), anchor_estimates(solution)
    truth = _true_anchors(reference, evaluation)
    low, high = _view(solution.floor_map, stations, anchors, truth.values())
    figure, axes = _empty_picture(low, high)
    if solution.floor_map is not None and solution.floor_map.occupancy.size:
        draw_floor_map(axes, solution.floor_map)
    ticks = heading_ticks(stations, length=0.022 * float(np.max(high - low)))
    draw_reference(axes, anchors, truth)
    draw_headings(axes, ticks)
    for draw in (draw_alternatives, draw_ellipses, draw_places):
        draw(axes, stations, STATION)
        draw(axes, anchors, ANCHOR)
    # A survey's name is anybody's text: a dollar sign in it is no formula.
    axes.set_title(_title(solution, evaluation), fontsize=11, parse_math=False)
    axes.set_xlabel("\n".join(["x / m", *_notes([*stations, *anchors], low, high)]), fontsize=9)
    if axes.get_legend_handles_labels()[1]:
        figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    obstacles = [*truth.values(), *(tip for _, tip in ticks)]
    place_labels(axes, _labels(stations, anchors, evaluation, truth), obstacles)
    return figure


def _empty_picture(low: Points, high: Points) -> tuple[Figure, Axes]:
    """A figure with equal axes in metres from the lower left to the upper right corner."""
    figure = Figure(figsize=_size(high - low), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_facecolor(str(_UNKNOWN))
    axes.set_ylabel("y / m", fontsize=9)
    axes.tick_params(labelsize=8)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=12, steps=[1, 2, 5, 10]))
    return figure, axes


def figure_png(figure: Figure) -> bytes:
    """The figure as PNG; the same figure gives the same bytes (no version, no date)."""
    stream = io.BytesIO()
    # Cut to what is drawn: a map keeps its proportions, so its axes leave part of the figure empty.
    figure.savefig(
        stream, format="png", metadata={"Software": None}, bbox_inches="tight", pad_inches=0.08
    )
    return stream.getvalue()


def draw_floor_map(axes: Axes, floor_map: FloorMap) -> None:
    """Greys: dark walls, white free space, grey where nobody looked."""
    height, width = floor_map.occupancy.shape
    x, y = floor_map.origin
    # Below one half a cell is rather free: white at once, so that only walls and the unknown are grey.
    darkness = np.clip(2.0 * floor_map.occupancy - 1.0, 0.0, 1.0)
    grey = np.where(np.isnan(darkness), _UNKNOWN, _FREE + (_OCCUPIED - _FREE) * darkness)
    edges = (x, x + width * floor_map.resolution, y, y + height * floor_map.resolution)
    limits = axes.axis()
    axes.imshow(grey, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=edges, zorder=0)
    axes.axis(limits)


def _true_anchors(reference: Reference | None, evaluation: Evaluation | None) -> dict[str, Points]:
    """(2,) m in the world frame by name; empty without a reference or an alignment."""
    if reference is None or evaluation is None or evaluation.reference_T_world is None:
        return {}
    world_T_reference = evaluation.reference_T_world.inverse()
    return {
        str(name): world_T_reference.transform([place.x, place.y])
        for name, place in reference.anchors.items()
        if np.isfinite([place.x, place.y]).all()
    }


def _view(
    floor_map: FloorMap | None,
    stations: Sequence[Estimate],
    anchors: Sequence[Estimate],
    truth: Iterable[Points],
) -> tuple[Points, Points]:
    """Lower left and upper right corner, m: all that is sure, and what is unsure as far as near."""
    items = [*stations, *anchors]
    sure = [i.position for i in items if i.position is not None and i.status is Status.OK]
    unsure = [i.position for i in items if i.position is not None and i.status is not Status.OK]
    corners = () if floor_map is None else floor_map.seen_corners
    seen = [*sure, *truth, *corners] or unsure or [np.zeros(2)]
    low, high = np.min(seen, axis=0), np.max(seen, axis=0)
    # An anchor of weak geometry may lie hundreds of metres off; the map must not shrink to a dot for it.
    reach = 0.5 * float(np.max(high - low)) + 1.0
    near = [p for p in unsure if np.all(p >= low - reach) and np.all(p <= high + reach)]
    low, high = np.min([low, *near], axis=0), np.max([high, *near], axis=0)
    margin = 0.4 + 0.03 * float(np.max(high - low))
    return low - margin, high + margin


def _size(extent: Points) -> tuple[float, float]:
    """Width and height in inches, with room for title, axes and legend."""
    width, height = extent * _LONG_SIDE_IN / np.max(extent)
    return max(float(width), _MIN_WIDTH_IN) + 0.6, max(float(height), _MIN_HEIGHT_IN) + 1.7


def _title(solution: Solution, evaluation: Evaluation | None) -> str:
    name = f"{textwrap.shorten(solution.survey_name, 60, placeholder=' ...')}, {solution.mode}"
    if evaluation is None:
        counts = [
            f"{sum(item.status is Status.OK for item in items)} of {len(items)} {what}"
            for what, items in (("stations", solution.stations), ("anchors", solution.anchors))
            if items
        ]
        return f"{name}: {' and '.join(counts)} ok" if counts else name
    if evaluation.reference_T_world is None:
        return f"{name}: cannot be compared with the reference"
    scores = [
        f"{what} RMSE {group.ok_errors.rmse:.3f} m ({group.ok_errors.count} ok of {group.expected})"
        for what, group in (("anchors", evaluation.anchors), ("stations", evaluation.stations))
        if group.ok_errors.count
    ]
    return "\n".join([name, *([", ".join(scores)] if scores else [])])


def _notes(items: Sequence[Estimate], low: Points, high: Points) -> list[str]:
    """Lines below the picture that name what is not in it."""
    missing = [f"{item.id} ({item.status})" for item in items if item.position is None]
    outside = [
        f"{item.id} at ({item.position[0]:.1f}, {item.position[1]:.1f})"
        for item in items
        if item.position is not None
        and not (np.all(item.position > low) and np.all(item.position < high))
    ]
    lines = []
    for title, names in (("without a place: ", missing), ("outside the picture: ", outside)):
        if names:
            text = textwrap.shorten(title + ", ".join(names), 300, placeholder=" ...")
            lines += textwrap.wrap(text, 100, break_on_hyphens=False)
    return lines


def _labels(
    stations: Sequence[Estimate],
    anchors: Sequence[Estimate],
    evaluation: Evaluation | None,
    truth: Mapping[str, Points],
) -> list[Label]:
    """Names of anchors, with the error where it is known, then of stations."""
    errors = (
        {} if evaluation is None else {item.id: item.error for item in evaluation.anchors.items}
    )
    labels = []
    for item in anchors:
        if item.position is not None:
            error = errors.get(item.id, np.nan)
            text = item.id if np.isnan(error) else f"{item.id}: {error:.2f} m"
            labels.append(Label(text, item.position, ANCHOR.colour, 9.0, bold=True))
    found = {item.id for item in anchors if item.position is not None}
    labels += [
        Label(name, place, "black", 8.0) for name, place in truth.items() if name not in found
    ]
    labels += [
        Label(f"{item.id}?", place, style.colour, 7.0)
        for items, style in ((anchors, ANCHOR), (stations, STATION))
        for item in items
        for place in item.alternatives
    ]
    size = 7.0 if len(stations) <= _MANY_STATIONS else 5.5
    # Hundreds of names make a picture unreadable; then only those that need attention are named.
    every = len(stations) <= _TOO_MANY_STATIONS
    labels += [
        Label(item.id, item.position, STATION.colour, size)
        for item in stations
        if item.position is not None and (every or item.status is not Status.OK)
    ]
    return labels
