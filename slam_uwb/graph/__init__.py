"""Matches and links -> station poses and anchors; the only home of GTSAM."""

from __future__ import annotations

from collections.abc import Callable

from ..model.products import GraphProblem
from ..model.settings import GraphSettings
from ..model.solution import GraphEstimate
from .joint import solve_joint
from .pose_graph import adjust_placement
from .sequential import solve_sequential

Solver = Callable[[GraphProblem, GraphSettings], GraphEstimate]

SOLVERS: dict[str, Solver] = {"joint": solve_joint, "sequential": solve_sequential}
"""Name of `GraphSettings.mode` to solver."""

__all__ = ["SOLVERS", "Solver", "adjust_placement"]
