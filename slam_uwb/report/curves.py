"""Curves with intervals: a figure of merit against what was varied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_COLOURS = ("#0072B2", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#56B4E9")


@dataclass(frozen=True, slots=True)
class Curve:
    """Values over abscissas, with their interval where there is one."""

    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] | None = None
    high: Sequence[float] | None = None


def draw_curves(
    title: str,
    labels: tuple[str, str],
    curves: Mapping[str, Curve],
    *,
    scales: tuple[str, str] = ("linear", "linear"),
) -> Figure:
    """One panel with a curve a name; intervals are shaded.

    Args:
        title: Above it.
        labels: Of x and y, with units.
        curves: By name.
        scales: Of x and y, `linear` or `log`.
    """
    figure = Figure(figsize=(7.0, 4.6), dpi=140, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xscale=scales[0], yscale=scales[1])
    for k, (name, curve) in enumerate(curves.items()):
        colour = _COLOURS[k % len(_COLOURS)]
        axes.plot(curve.x, curve.y, marker="o", markersize=4.0, color=colour, label=name)
        if curve.low is not None and curve.high is not None:
            axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.15, linewidth=0)
    axes.set_title(title, fontsize=10, parse_math=False)
    axes.set_xlabel(labels[0], fontsize=9)
    axes.set_ylabel(labels[1], fontsize=9)
    axes.tick_params(labelsize=8)
    if scales[1] == "linear":
        axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    if curves:
        axes.legend(fontsize=8)
    return figure
