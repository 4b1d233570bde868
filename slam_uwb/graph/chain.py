"""Poses by composing matches along a tree (paper, eq. 6-9), with their joint covariance.

The paper prints eq. 6-7 with the signs of a clockwise angle; here it is SE(2) composition,
``world_T_source = world_T_target @ target_T_source``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..model.geometry import FloatArray, Matrix3, Pose2
from ..model.products import GraphProblem, ScanMatch
from ..model.survey import StationId


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A match in the direction in which the tree is walked."""

    parent: StationId
    child: StationId
    parent_T_child: Pose2
    covariance: Matrix3
    """(3, 3) in the child's axes."""


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Poses of all stations that the tree reaches."""

    poses: dict[StationId, Pose2]
    """root_T_station, in the order in which they were reached."""
    covariance: FloatArray
    """(3 S, 3 S) joint, every pose in its own axes, the root's own uncertainty included."""


def held_together(problem: GraphProblem) -> tuple[StationId, ...]:
    """The largest group of placed stations that matches connect, in the survey's order.

    Empty where no two hold together; of groups of one size, the one with the earliest station.
    """
    placed = [station.id for station in problem.stations if station.id in problem.placement]
    tree = spanning_tree(problem)
    groups: list[tuple[StationId, ...]] = []
    for name in placed:
        if all(name not in group for group in groups):
            reached = {name} | {edge.child for edge in _walk(tree, name)}
            groups.append(tuple(other for other in placed if other in reached))
    largest = max(groups, key=len, default=())
    return largest if len(largest) >= 2 else ()


def spanning_tree(problem: GraphProblem) -> tuple[ScanMatch, ...]:
    """Matches that reach every station once: the sequence's first, then those with the best score.

    Where the sequence is not given this is the tree of maximum score; where it is, further stations
    and gaps are attached by that tree (Kruskal 1956). Matches that leave a direction free come last:
    a chain has no other to hold it.
    """
    order = {frozenset(pair): rank for rank, pair in enumerate(problem.sequence or ())}
    last = len(order)

    def priority(match: ScanMatch) -> tuple[bool, int, float, str, str]:
        pair = frozenset((match.target, match.source))
        # Names break ties, so that the order of the input does not matter.
        first, second = sorted((match.target, match.source))
        return match.degenerate, order.get(pair, last), -match.score, first, second

    group = {station.id: station.id for station in problem.stations}

    def root(name: StationId) -> StationId:
        while group[name] != name:
            name = group[name]
        return name

    tree = []
    for match in sorted(problem.matches, key=priority):
        a, b = root(match.target), root(match.source)
        if a != b:
            group[b] = a
            tree.append(match)
    return tuple(tree)


def compose_chain(
    tree: Iterable[ScanMatch], start: StationId, pose: Pose2, covariance: Matrix3
) -> Chain:
    """Compose matches outwards from one station.

    Args:
        tree: matches without cycles.
        start: the root.
        pose: of the root, world_T_start.
        covariance: (3, 3) of the root, in its own axes.
    """
    edges = _walk(tuple(tree), start)
    poses = {start: pose}
    # Columns are the independent causes of error: the root's pose, then every edge's match.
    causes = np.zeros((3, 3 * (len(edges) + 1)))
    causes[:, :3] = np.eye(3)
    jacobians = {start: causes}
    noise = np.zeros((causes.shape[1], causes.shape[1]))
    noise[:3, :3] = covariance
    for k, edge in enumerate(edges, start=1):
        poses[edge.child] = poses[edge.parent] @ edge.parent_T_child
        # P Exp(a) T Exp(b) = P T Exp(Ad(T^-1) a) Exp(b): errors before T turn into the child's axes.
        child = edge.parent_T_child.inverse().adjoint() @ jacobians[edge.parent]
        child[:, 3 * k : 3 * k + 3] = np.eye(3)
        jacobians[edge.child] = child
        noise[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = edge.covariance
    stacked = np.vstack([jacobians[name] for name in poses])
    return Chain(poses, stacked @ noise @ stacked.T)


def _walk(tree: tuple[ScanMatch, ...], start: StationId) -> list[Edge]:
    """Edges of the part of the tree that holds `start`, parents before children."""
    reached, left = {start}, list(tree)
    edges: list[Edge] = []
    while True:
        usable = [m for m in left if (m.target in reached) != (m.source in reached)]
        if not usable:
            return edges
        for match in usable:
            edge = _directed(match, match.target in reached)
            if edge.child not in reached:
                edges.append(edge)
                reached.add(edge.child)
            left.remove(match)


def _directed(match: ScanMatch, forward: bool) -> Edge:
    if forward:
        pose = match.target_T_source
        return Edge(match.target, match.source, pose, np.asarray(match.covariance))
    # (T Exp(xi))^-1 = T^-1 Exp(-Ad(T) xi)
    adjoint = match.target_T_source.adjoint()
    covariance = adjoint @ match.covariance @ adjoint.T
    return Edge(match.source, match.target, match.target_T_source.inverse(), covariance)
