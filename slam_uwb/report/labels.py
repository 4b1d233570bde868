"""Names beside their marks, where they cover as little as possible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from ..model.geometry import FloatArray, Points, Vector2

_DIRECTIONS = np.radians([45.0, 135.0, -45.0, -135.0, 0.0, 180.0, 90.0, -90.0])
_DISTANCES_PT = np.array([5.0, 11.0, 18.0])
_RANK = np.add.outer(
    4.0 * np.arange(len(_DISTANCES_PT)), np.linspace(0.0, 1.0, len(_DIRECTIONS))
).ravel()
"""What is better among equals: near the mark, and to its upper right, where people look first."""
_MARK_PT = 5.0
"""Half the edge of the square that a mark is taken for."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text and the place that it names."""

    text: str
    place: Vector2
    """(2,) m."""
    colour: str
    size: float
    """Points."""
    bold: bool = False


def place_labels(axes: Axes, labels: Sequence[Label], obstacles: Sequence[Points]) -> None:
    """Write the labels, the first ones with the freest choice.

    Greedy: each takes the cheapest of some positions round its mark, where covering a mark or an
    earlier label costs its area and distance costs a little.

    Args:
        axes: With limits, title and legend in place, since positions are looked for in pixels.
        labels: In order of importance.
        obstacles: (2,) m, further marks that should stay visible.
    """
    figure = axes.get_figure(root=True)
    if figure is None or not labels:
        return
    figure.draw_without_rendering()
    # Labels lie where their marks are now: to lay the figure out once more could only move these.
    figure.set_layout_engine("none")
    pixels_a_point = figure.dpi / 72.0
    frame = axes.get_window_extent()
    inside = [item for item in labels if frame.contains(*axes.transData.transform(item.place))]
    marks = axes.transData.transform(
        np.array([*(i.place for i in inside), *obstacles]).reshape(-1, 2)
    )
    half = _MARK_PT * pixels_a_point
    taken = np.hstack([marks - half, marks + half])
    for label, mark in zip(inside, marks, strict=False):
        text = _write(axes, label)
        extent = text.get_window_extent()
        boxes = _candidates(mark, (extent.width, extent.height), pixels_a_point)
        cost = _covered(boxes, taken) + 1e3 * _outside(boxes, np.array([*frame.min, *frame.max]))
        best = boxes[int(np.argmin(cost + 0.02 * extent.width * extent.height * _RANK))]
        x, y = axes.transData.inverted().transform(best[:2])
        text.set_position((float(x), float(y)))
        taken = np.vstack([taken, best])


def _write(axes: Axes, label: Label) -> Text:
    x, y = label.place
    text = axes.text(
        x, y, label.text, color=label.colour, fontsize=label.size, ha="left", va="bottom", zorder=8,
        fontweight="bold" if label.bold else "normal", clip_on=True,
    )  # fmt: skip
    text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    # A label must not push the axes about, since it was placed for where they are.
    text.set_in_layout(False)
    return text


def _candidates(mark: Vector2, size: tuple[float, float], pixels_a_point: float) -> FloatArray:
    """(C, 4) boxes in pixels, left, bottom, right, top, nearest first."""
    way = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
    steps = _DISTANCES_PT[:, None, None] * pixels_a_point * way
    # The box touches the circle round the mark with the corner or the edge that faces it.
    corner = np.where(np.abs(way) < 0.1, -0.5, np.where(way < 0.0, -1.0, 0.0)) * size
    low = (mark + steps + corner).reshape(-1, 2)
    return np.hstack([low, low + size])


def _covered(boxes: FloatArray, taken: FloatArray) -> FloatArray:
    """(C,) square pixels of what is taken that each box covers."""
    low = np.maximum(boxes[:, None, :2], taken[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], taken[None, :, 2:])
    return np.asarray(np.prod(np.maximum(high - low, 0.0), axis=2).sum(axis=1))


def _outside(boxes: FloatArray, frame: FloatArray) -> FloatArray:
    """(C,) pixels by which each box leaves the frame."""
    beyond = np.maximum(frame[:2] - boxes[:, :2], 0.0) + np.maximum(boxes[:, 2:] - frame[2:], 0.0)
    return np.asarray(beyond.sum(axis=1))
