"""The marks of a picture: places, headings, ellipses, alternatives, true places.

Colours are those of Okabe and Ito (2008), which people with any colour vision tell apart; shapes and
fillings say the same once more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Ellipse

from ..evaluate.estimates import Estimate
from ..model.geometry import Points
from ..model.solution import Status

_BLUE, _VERMILLION, _GREEN, _BLACK = "#0072B2", "#D55E00", "#009E73", "#000000"
_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Style:
    """How one kind of thing looks."""

    name: str
    marker: str
    colour: str
    size: float
    """Points."""


STATION = Style("station", "o", _BLUE, 5.0)
ANCHOR = Style("anchor", "^", _VERMILLION, 9.0)

_FILLING: dict[Status, Literal["full", "left", "bottom", "none"]] = {
    Status.OK: "full",
    Status.MIRROR_AMBIGUOUS: "left",
    Status.AMBIGUOUS: "bottom",
}


def draw_places(axes: Axes, items: Sequence[Estimate], style: Style) -> None:
    """Every item that has a place, one legend entry a status."""
    for status in Status:
        places = [i.position for i in items if i.position is not None and i.status is status]
        if not places:
            continue
        x, y = np.array(places).T
        axes.plot(
            x, y, linestyle="none", marker=style.marker, markersize=style.size,
            fillstyle=_FILLING.get(status, "none"), color=style.colour, markerfacecoloralt="white",
            markeredgewidth=1.2, zorder=6,
            label=style.name if status is Status.OK else f"{style.name}, {status}",
        )  # fmt: skip


def heading_ticks(stations: Sequence[Estimate], length: float) -> list[tuple[Points, Points]]:
    """From each station whose heading is known to `length` m along its scanner's zero."""
    return [
        (s.position, s.position + length * np.array([math.cos(s.heading), math.sin(s.heading)]))
        for s in stations
        if s.position is not None and math.isfinite(s.heading)
    ]


def draw_headings(axes: Axes, ticks: Sequence[tuple[Points, Points]]) -> None:
    """The ticks of `heading_ticks`."""
    axes.add_collection(
        LineCollection(list(ticks), colors=STATION.colour, linewidths=1.2, zorder=5)
    )


def draw_ellipses(axes: Axes, items: Sequence[Estimate], style: Style) -> None:
    """Ellipses of two sigmas; 86 % of the errors lie inside where the covariance is right."""
    label = f"{style.name}, {_SIGMAS:g} sigma"
    for item in items:
        if item.position is None or item.covariance is None:
            continue
        if not np.isfinite(item.covariance).all():
            continue
        variances, directions = np.linalg.eigh(item.covariance[:2, :2])
        width, height = 2.0 * _SIGMAS * np.sqrt(np.maximum(variances, 0.0))
        ellipse = Ellipse(
            (float(item.position[0]), float(item.position[1])), width, height,
            angle=math.degrees(math.atan2(directions[1, 0], directions[0, 0])),
            facecolor=to_rgba(style.colour, 0.15), edgecolor=style.colour, linewidth=0.9,
            linestyle="-" if item.status is Status.OK else "--", zorder=4, label=label,
        )  # fmt: skip
        axes.add_patch(ellipse)
        label = "_nolegend_"


def draw_alternatives(axes: Axes, items: Sequence[Estimate], style: Style) -> None:
    """Other places that the data do not exclude, tied to the estimate where there is one."""
    places = [place for item in items for place in item.alternatives]
    if not places:
        return
    x, y = np.array(places).T
    axes.plot(
        x, y, linestyle="none", marker=style.marker, markersize=0.7 * style.size, fillstyle="none",
        color=style.colour, alpha=0.7, markeredgewidth=0.8, zorder=5,
        label=f"{style.name}, other place not excluded",
    )  # fmt: skip
    ties = [
        (item.position, place)
        for item in items
        if item.position is not None
        for place in item.alternatives
    ]
    axes.add_collection(
        LineCollection(ties, colors=style.colour, linestyles=":", linewidths=0.8, zorder=3)
    )


def draw_reference(axes: Axes, anchors: Sequence[Estimate], truth: Mapping[str, Points]) -> None:
    """True places of anchors as crosses, with a line to the estimate of each."""
    if not truth:
        return
    x, y = np.array(list(truth.values())).T
    axes.plot(
        x, y, linestyle="none", marker="x", markersize=8.0, markeredgewidth=1.8, color=_BLACK, zorder=7,
        label="anchor, reference",
    )  # fmt: skip
    lines = [
        (truth[item.id], item.position)
        for item in anchors
        if item.position is not None and item.id in truth
    ]
    axes.add_collection(
        LineCollection(lines, colors=_GREEN, linewidths=1.8, zorder=5, label="error")
    )
