"""Which stretches are wall and which are furniture.

A tripod at chest height sees both. A wall is long, and goes on behind a door; it has a second face
a hand's breadth behind the first and stands against another wall; furniture is short and stands in
front of a wall.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import expit

from ..model.geometry import FloatArray
from ..model.settings import MappingSettings
from .wall_lines import WallLines
from .wall_runs import WallRuns, near_pairs

_PARALLEL = math.cos(math.radians(14.0))
_THICKNESS_M = (0.05, 0.28)
"""Between the faces of a wall between rooms, and not of a bookshelf (0.3 m and more)."""
_TWO_FACED_M = 1.0
"""A thin wall with both faces that stands against another is worth as much length more."""
_DEPTH_M = (0.2, 0.9)
"""Of furniture that stands before a wall; a room is not that narrow."""
_REACH_M = 0.35
"""A wall that ends so near another stands against it: a wall's thickness and noise."""
_BEND = math.cos(math.radians(25.0))
_BEND_GAP_M = 0.35
_BEND_OVERLAP_M = 1.0
_BEND_LEAST_M = 0.6
"""Pieces of a round wall turn by less, lie closer and are longer than clutter."""
_FURNITURE, _WALL = 0.1, 0.97
"""Probability that something short, something long is a wall: never certain."""
_BEFORE_WALL = 0.9
"""Share of what stands before a certain wall that is furniture."""
_RAISED_WALL, _RAISED_FREE = 0.97, 0.02
"""Probability that what raised scans saw, or looked over, is a wall: their errors and those of poses are left."""


def wall_probability(runs: WallRuns, lines: WallLines, settings: MappingSettings) -> FloatArray:
    """(R,) probability that a stretch is wall, from its length, what is behind it, and raised scans."""
    probability = chain_probability(runs.support, settings)
    probability *= 1.0 - _BEFORE_WALL * wall_behind(runs, lines, probability)
    told = np.where(runs.raised > 0.0, _RAISED_WALL, _RAISED_FREE)
    return np.asarray(probability + np.abs(runs.raised) * (told - probability))


def chain_probability(support: FloatArray, settings: MappingSettings) -> FloatArray:
    """(R,) probability that what was seen over `support` m is a wall."""
    likely = expit((support - settings.wall_chain_m) / settings.wall_chain_slope_m)
    return np.asarray(_FURNITURE + (_WALL - _FURNITURE) * likely)


def support_round_bends(runs: WallRuns, lines: WallLines) -> FloatArray:
    """(R,) m, support of all chains that follow each other at gentle bends: a round wall is one wall.

    Furniture has right angles.
    """
    i, j = near_pairs(runs, lines, _BEND_GAP_M)
    # Where one ends the other goes on, both walked with the room on the left.
    height, _, end = _seen_from(runs, lines, i, j)
    begin, stop = runs.span[j].T
    follows = (np.abs(height[:, 1]) < _BEND_GAP_M) & (end > begin - _BEND_GAP_M)
    follows &= (end < stop - _BEND_GAP_M) & (end < begin + _BEND_OVERLAP_M)
    bend = follows & (_turn(runs, lines, i, j) > _BEND) & runs.seen[i] & runs.seen[j]
    bend &= np.minimum(runs.support[i], runs.support[j]) > _BEND_LEAST_M
    chains = int(runs.chain.max(initial=-1)) + 1
    own = np.zeros(chains)
    own[runs.chain] = runs.support
    joined = coo_array(
        (np.ones(int(bend.sum())), (runs.chain[i[bend]], runs.chain[j[bend]])), (chains, chains)
    )
    _, group = connected_components(joined, directed=False)
    return np.asarray(np.bincount(group, weights=own)[group][runs.chain])


def support_of_both_faces(
    runs: WallRuns, lines: WallLines, settings: MappingSettings
) -> FloatArray:
    """(R,) m, the chain's support and, of walls that stand against another, that of the other face.

    A stub of wall beside a door is shorter than a cupboard, but thin, seen from both sides, and
    stands against a long wall. A screen is thin and seen from both sides, and stands free.
    """
    i, j = near_pairs(runs, lines, 2.0 * _REACH_M)
    height, low, high = _seen_from(runs, lines, i, j)
    depth = -height.mean(axis=1)
    turn = _turn(runs, lines, i, j)
    beside = np.maximum(low - runs.span[j, 1], runs.span[j, 0] - high) < _REACH_M
    faces = (turn < -_PARALLEL) & (depth > _THICKNESS_M[0]) & (depth < _THICKNESS_M[1])
    faces &= beside & runs.seen[i] & runs.seen[j]
    against = (np.abs(turn) < 0.87) & (np.abs(height).min(axis=1) < _REACH_M) & beside
    against &= runs.seen[j] & (runs.support[j] > settings.wall_chain_m)

    chains = int(runs.chain.max(initial=-1)) + 1
    attached = np.zeros(chains, dtype=np.bool_)
    attached[runs.chain[i[against]]] = True
    faces &= attached[runs.chain[i]] | attached[runs.chain[j]]
    other = np.zeros(chains)
    np.maximum.at(other, runs.chain[i[faces]], runs.support[j[faces]] + _TWO_FACED_M)
    return np.asarray(runs.support + other[runs.chain])


def wall_behind(runs: WallRuns, lines: WallLines, probability: FloatArray) -> FloatArray:
    """(R,) probability that a wall that faces the same way stands close behind.

    What stands before it is furniture, however long: a row of cupboards, a kitchen; at most a
    pillar, which is one wall together with what is behind it.
    """
    i, j = near_pairs(runs, lines, 2.0 * _DEPTH_M[1])
    height, low, high = _seen_from(runs, lines, i, j)
    depth = height.mean(axis=1)
    before = (_turn(runs, lines, i, j) > _PARALLEL) & (depth > _DEPTH_M[0]) & (depth < _DEPTH_M[1])
    covered = np.minimum(high, runs.span[j, 1]) - np.maximum(low, runs.span[j, 0])
    share = np.clip(covered / np.maximum(high - low, 1e-9), 0.0, 1.0)
    weight = np.where(before, share * probability[j], 0.0)
    return np.minimum(np.bincount(i, weights=weight, minlength=len(runs.line)), 1.0)


def _turn(
    runs: WallRuns, lines: WallLines, i: NDArray[np.int64], j: NDArray[np.int64]
) -> FloatArray:
    """(N,) cosine between the ways that two runs face."""
    normals = lines.normals[runs.line]
    return np.asarray(np.einsum("nk,nk->n", normals[i], normals[j]))


def _seen_from(
    runs: WallRuns, lines: WallLines, i: NDArray[np.int64], j: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run i on the line of run j: (N, 2) m its ends are before the line, (N,) from and to where along it."""
    ends, on = runs.ends(lines)[i], runs.line[j]
    height = np.einsum("nek,nk->ne", ends, lines.normals[on]) - lines.offsets[on, None]
    along = np.einsum("nek,nk->ne", ends, lines.directions[on])
    return height, along.min(axis=1), along.max(axis=1)
