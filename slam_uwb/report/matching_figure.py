"""One match step by step, in the manner of the paper's Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ..model.geometry import FloatArray, Points, Pose2
from ..model.products import PreparedScan

_TARGET, _SOURCE, _TRIPLE = "#0072B2", "#D55E00", "#009E73"


def draw_match_steps(
    target: PreparedScan,
    source: PreparedScan,
    triple: tuple[Points, Points],
    steps: Sequence[tuple[str, Pose2]],
) -> Figure:
    """Wall lines and landmarks of both scans with a corresponding triple; then the scans at each pose.

    Args:
        target: Scan m, in its own frame.
        source: Scan n.
        triple: (3, 2) m corners in m's frame and the same in n's.
        steps: Title and target_T_source of each further panel, such as the initial and the refined fit.
    """
    figure = Figure(figsize=(10.0, 4.6 * (1 + (len(steps) + 1) // 2)), dpi=130)
    figure.set_layout_engine("constrained")
    FigureCanvasAgg(figure)
    rows = 1 + (len(steps) + 1) // 2
    for k, (scan, corners, colour) in enumerate(
        ((target, triple[0], _TARGET), (source, triple[1], _SOURCE))
    ):
        axes = figure.add_subplot(rows, 2, k + 1, aspect="equal")
        _draw_landmarks(axes, scan, corners, colour)
    for k, (title, pose) in enumerate(steps):
        axes = figure.add_subplot(rows, 2, k + 3, aspect="equal")
        axes.plot(*target.points.T, ".", color=_TARGET, markersize=3.0, label=str(target.station))
        moved = pose.transform(source.points)
        axes.plot(*moved.T, ".", color=_SOURCE, markersize=3.0, label=f"{source.station}, moved")
        axes.set_title(title, fontsize=10, parse_math=False)
        _finish(axes)
    return figure


def _draw_landmarks(axes: Axes, scan: PreparedScan, corners: Points, colour: str) -> None:
    axes.plot(*scan.points.T, ".", color="grey", markersize=2.0, label="scan")
    lines: FloatArray = scan.segments
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=2.0, label="walls"))
    low, high = scan.points.min(axis=0) - 1.0, scan.points.max(axis=0) + 1.0
    near = np.all((scan.landmarks > low) & (scan.landmarks < high), axis=1)
    axes.plot(
        *scan.landmarks[near].T, "o", color="black", fillstyle="none", markersize=5.0,
        label="landmarks",
    )  # fmt: skip
    closed = np.vstack([corners, corners[:1]])
    axes.plot(
        *closed.T,
        "--*",
        color=_TRIPLE,
        markersize=11.0,
        linewidth=1.2,
        label="corresponding triple",
    )
    axes.set_title(f"{scan.station}: walls and landmarks", fontsize=10, parse_math=False)
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.set_xlabel("x / m", fontsize=8)
    axes.set_ylabel("y / m", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=7, loc="best")
