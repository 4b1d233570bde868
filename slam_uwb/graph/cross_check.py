"""Other ways to the solution: they have to end where it is."""

from __future__ import annotations

import math
from dataclasses import replace

import gtsam
import numpy as np

from ..model.geometry import Pose2, Vector2
from ..model.settings import GraphSettings
from ..model.solution import SolverChecks
from ..model.survey import AnchorId
from .incremental import Optimum, incremental_problem, solve_by_passes
from .variables import Indices, Variables, from_values, to_values

_NEAR_M, _NEAR_RAD = 0.02, 0.005
"""The batch solver starts this far off, or it would return its start."""
_MAX_ITERATIONS = 1000
"""A handful is the rule; along the line of its stations an anchor creeps."""
_LEAST_DAMPING = 1e-12
_FAR_M, _STARTS = 0.3, 2
"""Anchors are tried from this far away: on the other side of a wall the labels would be others."""
_LOWER_COST = 1e-6
"""nats by which another optimum has to be better."""


def check_optimum(optimum: Optimum, indices: Indices, settings: GraphSettings) -> SolverChecks:
    """How far batch Levenberg-Marquardt and the best of other starts end from the optimum."""
    return SolverChecks(
        isam2_batch_gap=batch_gap(optimum, indices),
        other_starts_gap=other_starts_gap(optimum, indices, settings),
        iterations=optimum.passes,
        cost=optimum.cost,
    )


def batch_gap(optimum: Optimum, indices: Indices) -> float:
    """m, how far from the optimum iSAM2 and batch Levenberg-Marquardt, from somewhat off, end."""
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-14)
    parameters.setAbsoluteErrorTol(1e-14)
    parameters.setMaxIterations(_MAX_ITERATIONS)
    # Without a bound hundreds of accepted steps divide it down to zero, which never grows again: the
    # first step that fails would be tried for ever.
    parameters.setlambdaLowerBound(_LEAST_DAMPING)
    start = _displaced(optimum.variables, _NEAR_M, _NEAR_RAD, 0.0)
    values = to_values(start, indices, with_offset=bool(optimum.problem.ends))
    batch = gtsam.LevenbergMarquardtOptimizer(optimum.graph, values, parameters).optimize()
    incremental = incremental_problem(optimum).calculateEstimate()
    ends = [from_values(values, optimum.variables, indices) for values in (batch, incremental)]
    return max(_gap(optimum.variables, end) for end in ends)


def other_starts_gap(optimum: Optimum, indices: Indices, settings: GraphSettings) -> float:
    """m, how far a better optimum lies that other starts of the anchors lead to; 0 where none is better."""
    best = optimum
    if not optimum.variables.anchors:
        return 0.0
    for turn in 2.0 * math.pi * np.arange(_STARTS) / _STARTS:
        start = _displaced(optimum.variables, _FAR_M, 0.0, float(turn))
        start = replace(start, poses=optimum.variables.poses)
        problem = optimum.problem
        other = solve_by_passes(problem.fixed, problem.ranges, start, indices, settings)
        if other.cost < best.cost - _LOWER_COST:
            best = other
    return _gap(optimum.variables, best.variables)


def _displaced(variables: Variables, metres: float, radians: float, turn: float) -> Variables:
    """Everything moved by as much, each thing another way."""
    poses = {
        name: Pose2(
            pose.x + metres * math.cos(turn + k),
            pose.y + metres * math.sin(turn + k),
            pose.theta + radians * math.cos(k),
        )
        for k, (name, pose) in enumerate(variables.poses.items())
    }
    anchors: dict[AnchorId, Vector2] = {
        name: place + metres * np.array([math.cos(turn - k), math.sin(turn - k)])
        for k, (name, place) in enumerate(variables.anchors.items())
    }
    return replace(variables, poses=poses, anchors=anchors)


def _gap(one: Variables, other: Variables) -> float:
    """m, largest distance of a station or anchor."""
    gaps = [pose.distance_to(other.poses[name]) for name, pose in one.poses.items()]
    gaps += [math.dist(place, other.anchors[name]) for name, place in one.anchors.items()]
    return max(gaps, default=0.0)
