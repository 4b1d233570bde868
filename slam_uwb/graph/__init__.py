"""Matches and links -> station poses and anchors; the only home of GTSAM."""

from __future__ import annotations

from typing import Protocol

from ..model.products import GraphProblem, Share, alone
from ..model.settings import GraphSettings
from ..model.solution import GraphEstimate
from .joint import solve_joint
from .pose_graph import adjust_placement
from .sequential import solve_sequential


class Solver(Protocol):
    """Poses and anchors of one problem; may share work out."""

    def __call__(
        self, problem: GraphProblem, settings: GraphSettings, share: Share = alone
    ) -> GraphEstimate:
        """The estimate, which does not depend on how work is shared out."""


SOLVERS: dict[str, Solver] = {"joint": solve_joint, "sequential": solve_sequential}
"""Name of `GraphSettings.mode` to solver."""

__all__ = ["SOLVERS", "Solver", "adjust_placement"]
