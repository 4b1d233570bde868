"""Walls reach on to the wall that they meet, where furniture hides the corner."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from ..model.settings import MappingSettings
from .wall_evidence import WallCells
from .wall_lines import WallLines
from .wall_runs import WallRuns, free_share, near_pairs

_FLATTEST = math.sin(math.radians(30.0))
"""Lines that meet at a smaller angle make no corner."""
_BEND = math.cos(math.radians(30.0))
"""Of a round wall the pieces turn by less."""
_PAST_M = 0.35
"""A wall may have been seen so far past the line it ends at: noise, or the thickness of the wall it meets."""


def corner_gaps(
    runs: WallRuns,
    walls: NDArray[np.bool_],
    lines: WallLines,
    cells: WallCells,
    settings: MappingSettings,
) -> tuple[NDArray[np.int64], FloatArray]:
    """Hidden stretches between the end of a wall and the next wall across it.

    The stretch must be as short as a gap that is filled, and not looked through; the other wall must
    reach the corner itself, or be hidden there likewise.

    Args:
        runs: Walls and furniture.
        walls: (R,) which of them are walls: they alone go on, and end others.
        lines: Of the runs.
        cells: What was looked through.
        settings: `wall_fill_...`.

    Returns:
        (G,) run that goes on, and (G, 2) m the span on its line by which it does.
    """
    wide = settings.wall_fill_gap_m
    run, other = near_pairs(runs, lines, math.sqrt(2.0) * wide)
    run, other, at, at_other = _crossings(runs, walls, lines, run, other)
    low, high = _short_of(runs.span[run], at)
    low_other, high_other = _short_of(runs.span[other], at_other)
    gap = high - low
    upper, inside = _nearer_end(runs.span[run], at)
    closed = _closed_ends(runs, walls, lines)[run, upper.astype(np.int64)]
    fits = (
        (gap <= np.where(closed, _PAST_M, wide))
        & (high_other - low_other <= wide)
        & (inside <= _PAST_M)
        & _hidden(cells, runs.line[run], low, high, settings)
        & _hidden(cells, runs.line[other], low_other, high_other, settings)
    )
    chosen = _nearest(2 * run + upper, gap, fits)
    return run[chosen], np.column_stack([low, high])[chosen]


def _nearest(end: NDArray[np.int64], gap: FloatArray, fits: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Of each end's fitting corners the nearest, if it is not reached already: behind it is another room."""
    fitting = np.flatnonzero(fits)
    order = fitting[np.lexsort((gap[fitting], end[fitting]))]
    _, first = np.unique(end[order], return_index=True)
    chosen = order[first]
    return np.asarray(chosen[gap[chosen] > 0.0])


def _crossings(
    runs: WallRuns,
    walls: NDArray[np.bool_],
    lines: WallLines,
    run: NDArray[np.int64],
    other: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray, FloatArray]:
    """The pairs of walls whose lines cross, and where on the one line and on the other, m."""
    along, across = lines.directions[runs.line[run]], lines.normals[runs.line[other]]
    sine = np.einsum("ij,ij->i", along, across)
    meet = (np.abs(sine) > _FLATTEST) & walls[run] & walls[other]
    run, other, along, across, sine = run[meet], other[meet], along[meet], across[meet], sine[meet]
    foot = lines.offsets[runs.line[run], None] * lines.normals[runs.line[run]]
    at = (lines.offsets[runs.line[other]] - np.einsum("ij,ij->i", foot, across)) / sine
    corner = foot + at[:, None] * along
    return run, other, at, np.einsum("ij,ij->i", corner, lines.directions[runs.line[other]])


def _closed_ends(runs: WallRuns, walls: NDArray[np.bool_], lines: WallLines) -> NDArray[np.bool_]:
    """(R, 2) whether another wall takes over there at a bend: a round wall does not go on straight."""
    run, other = near_pairs(runs, lines, _PAST_M)
    normals = lines.normals[runs.line]
    bend = np.einsum("nk,nk->n", normals[run], normals[other]) > _BEND
    bend &= (runs.line[run] != runs.line[other]) & walls[other]
    run, other = run[bend], other[bend]
    ends, on = runs.ends(lines)[run], runs.line[other]
    away = np.einsum("nek,nk->ne", ends, lines.normals[on]) - lines.offsets[on, None]
    along = np.einsum("nek,nk->ne", ends, lines.directions[on])
    past = along - np.clip(along, runs.span[other, :1], runs.span[other, 1:])
    closed = np.zeros((len(runs.line), 2), dtype=np.bool_)
    np.logical_or.at(closed, run, np.hypot(away, past) < _PAST_M)
    return closed


def _nearer_end(span: FloatArray, at: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
    """Whether a place (N,) on the line is nearer to the upper end of a span (N, 2), and how far inside it is."""
    upper = at > span.mean(axis=1)
    return upper, np.where(upper, span[:, 1] - at, at - span[:, 0])


def _short_of(span: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What lies between a span (N, 2) and a place (N,) on its line; nothing where the place is in it."""
    nearest = np.clip(at, span[:, 0], span[:, 1])
    return np.minimum(nearest, at), np.maximum(nearest, at)


def _hidden(
    cells: WallCells,
    line: NDArray[np.int64],
    low: FloatArray,
    high: FloatArray,
    settings: MappingSettings,
) -> NDArray[np.bool_]:
    """(N,) whether hardly anything of the stretches was looked through; two cells tell nothing."""
    share = free_share(cells, line, low, high, settings.wall_cell_m)
    short = high - low < 2.0 * settings.wall_cell_m
    return np.asarray(short | (share < settings.wall_fill_free_share))
