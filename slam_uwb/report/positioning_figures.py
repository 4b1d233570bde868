"""Located tags as pictures, in the manner of the paper's Fig. 5b, 5c and 6."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ..evaluate import ecdf
from ..model.floor import FloorMap
from ..model.geometry import Points
from .figures import draw_floor_map

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Of Okabe and Ito (2008)."""
_MARKERS = ("s", "^", "D", "v", "o", "P")
_MARGIN_M = 0.6
_LONG_SIDE_IN = 9.0

Places = Mapping[str, Points]
"""(2,) m by name."""


def draw_static_tags(
    title: str,
    truth: Places,
    located: Mapping[str, Places],
    floor_map: FloorMap | None = None,
) -> Figure:
    """True places as crosses, each method's as marks with a line to the truth (Fig. 5b).

    Args:
        title: Above the picture.
        truth: In the map's frame; may be empty.
        located: Places by tag, by method.
        floor_map: Behind it all.
    """
    shown = [*truth.values(), *(place for found in located.values() for place in found.values())]
    figure, axes = _picture(title, shown, floor_map)
    for k, (method, found) in enumerate(located.items()):
        colour = _COLOURS[k % len(_COLOURS)]
        ties = [(truth[name], place) for name, place in found.items() if name in truth]
        axes.add_collection(LineCollection(ties, colors=colour, linewidths=1.0, zorder=4))
        if found:
            x, y = np.array(list(found.values())).T
            axes.plot(
                x, y, linestyle="none", marker=_MARKERS[k % len(_MARKERS)], markersize=6.0,
                fillstyle="none", markeredgewidth=1.4, color=colour, label=method, zorder=5,
            )  # fmt: skip
    if truth:
        x, y = np.array(list(truth.values())).T
        axes.plot(x, y, "x", color="black", markersize=6.0, label="true place", zorder=6)
    _legend(figure, axes)
    return figure


def draw_walk(
    title: str,
    path: Points | None,
    tracks: Mapping[str, Points],
    floor_map: FloorMap | None = None,
    anchors: Mapping[str, Points] | None = None,
) -> Figure:
    """The path walked and each method's track, with the anchors it used (Fig. 5c).

    Args:
        title: Above the picture.
        path: (N, 2) m corners in the map's frame, where they are known.
        tracks: (E, 2) m by method; NaN is no place.
        floor_map: Behind it all.
        anchors: (A, 2) m by method.
    """
    shown = [] if path is None else list(path)
    shown += [place for track in tracks.values() for place in track]
    figure, axes = _picture(title, shown, floor_map)
    if path is not None:
        axes.plot(*path.T, color="black", linewidth=2.5, alpha=0.5, label="path walked", zorder=3)
    for k, (method, track) in enumerate(tracks.items()):
        colour = _COLOURS[k % len(_COLOURS)]
        axes.plot(
            *track.T, color=colour, linewidth=1.0, marker=".", markersize=3.0, label=method,
            zorder=4 + k,
        )  # fmt: skip
        used = (anchors or {}).get(method)
        if used is not None and len(used):
            axes.plot(
                *used.T, linestyle="none", marker=_MARKERS[k % len(_MARKERS)], markersize=8.0,
                fillstyle="none", markeredgewidth=1.4, color=colour, zorder=6,
                label=f"{method}: anchors",
            )  # fmt: skip
    _legend(figure, axes)
    return figure


def draw_distributions(panels: Mapping[str, Mapping[str, ArrayLike]], unit: str = "m") -> Figure:
    """Empirical distribution functions side by side, one panel a title, one curve a method (Fig. 6)."""
    count = max(len(panels), 1)
    figure = Figure(figsize=(5.5 * count, 4.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    for k, (title, curves) in enumerate(panels.items()):
        axes = figure.add_subplot(1, count, k + 1)
        for number, (method, errors) in enumerate(curves.items()):
            values, shares = ecdf(errors)
            if len(values):
                label = f"{method}, median {np.median(values):.2f} {unit}"
                colour = _COLOURS[number % len(_COLOURS)]
                # From zero: nothing is smaller than the smallest.
                x, y = np.append(values[0], values), np.append(0.0, shares)
                axes.step(x, y, where="post", color=colour, label=label)
        axes.set_title(title, fontsize=10, parse_math=False)
        axes.set_xlabel(f"error / {unit}", fontsize=9)
        axes.set_ylabel("share no larger", fontsize=9)
        axes.set_xlim(left=0.0)
        axes.set_ylim(0.0, 1.02)
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=8, loc="lower right")
    return figure


def _picture(
    title: str, shown: Sequence[Points], floor_map: FloorMap | None
) -> tuple[Figure, Axes]:
    """An empty picture round the places, with the map in it."""
    places = np.array(shown).reshape(-1, 2)
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        places = np.zeros((1, 2))
    low, high = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
    if floor_map is not None and floor_map.occupancy.size:
        height, width = floor_map.occupancy.shape
        corner = np.asarray(floor_map.origin)
        low = np.minimum(low, corner)
        high = np.maximum(high, corner + floor_map.resolution * np.array([width, height]))
    size = _LONG_SIDE_IN * (high - low) / np.max(high - low)
    figure = Figure(
        figsize=(max(size[0], 5.0), max(size[1], 2.5) + 1.4), dpi=150, layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    if floor_map is not None and floor_map.occupancy.size:
        draw_floor_map(axes, floor_map)
    axes.set_title(title, fontsize=11, parse_math=False)
    axes.set_xlabel("x / m", fontsize=9)
    axes.set_ylabel("y / m", fontsize=9)
    axes.tick_params(labelsize=8)
    return figure, axes


def _legend(figure: Figure, axes: Axes) -> None:
    if axes.get_legend_handles_labels()[1]:
        figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
