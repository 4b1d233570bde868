"""A comparison as one picture: bars of the anchors' RMSE, and how their errors are distributed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..evaluate import ecdf
from ..evaluate.comparison import MethodResult

COLOURS = {"joint": "#0072B2", "sequential": "#E69F00"}
"""Of Okabe and Ito (2008)."""
_ROW_IN, _HEAD_IN = 0.24, 1.1


def draw_comparison(results: Sequence[MethodResult]) -> Figure:
    """One row a survey: left a bar a method, right the ECDF of the anchors' errors by mode.

    A method that failed, or that a survey has no truth for, has its name and no bar.

    Returns:
        A figure with an Agg canvas, for `figure_png`.
    """
    surveys = list(dict.fromkeys(row.survey for row in results)) or [""]
    parts = [[row for row in results if row.survey == name] for name in surveys]
    heights = [_HEAD_IN + _ROW_IN * max(len(part), 4) for part in parts]
    figure = Figure(figsize=(11.0, sum(heights)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(parts), 2, height_ratios=heights, width_ratios=(1.3, 1.0))
    for k, part in enumerate(parts):
        _draw_bars(figure.add_subplot(grid[k, 0]), part)
        _draw_distributions(figure.add_subplot(grid[k, 1]), part)
    return figure


def _draw_bars(axes: Axes, rows: Sequence[MethodResult]) -> None:
    places = [float(k) for k in range(len(rows))]
    known = [row.anchor_rmse if math.isfinite(row.anchor_rmse) else 0.0 for row in rows]
    axes.barh(places, known, color=[COLOURS.get(row.mode, "grey") for row in rows])
    axes.set_yticks(places, [row.method for row in rows], fontsize=8)
    axes.invert_yaxis()
    for place, row, value in zip(places, rows, known, strict=True):
        axes.text(value, place, f" {_remark(row)}", va="center", fontsize=7, parse_math=False)
    axes.set_xlim(0.0, 1.5 * max([*known, 0.1]))
    axes.set_xlabel("anchor RMSE / m", fontsize=8)
    axes.tick_params(labelsize=8)
    title = rows[0].survey if rows else "nothing was compared"
    axes.set_title(title, fontsize=10, parse_math=False)


def _remark(row: MethodResult) -> str:
    if row.failure:
        first = row.failure.splitlines()[0]
        return f"failed: {first[:40]}{'...' if len(first) > 40 else ''}"
    counts = f"{row.anchors_ok} of {row.anchors} ok"
    return f"{row.anchor_rmse:.2f} m, {counts}" if math.isfinite(row.anchor_rmse) else counts


def _draw_distributions(axes: Axes, rows: Sequence[MethodResult]) -> None:
    for mode in dict.fromkeys(row.mode for row in rows):
        errors = [e for row in rows if row.mode == mode for e in row.anchor_errors]
        if errors:
            values, shares = ecdf(errors)
            axes.step(
                values, shares, where="post", color=COLOURS.get(mode, "grey"),
                label=f"{mode}, {len(errors)} errors",
            )  # fmt: skip
    axes.set_xlabel("error of an anchor / m", fontsize=8)
    axes.set_ylabel("share no larger", fontsize=8)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.3)
    axes.tick_params(labelsize=8)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=8, loc="upper left")
