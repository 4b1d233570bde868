"""What a range from a place is expected to be worth: whether it is heard, and how wrong it may be."""

from __future__ import annotations

import numpy as np
from scipy.special import expit, log_expit

from ..model.geometry import FloatArray, Points
from ..model.settings import PlanningSettings
from ..model.solution import Solution
from .views import walls_between

_WALL_LOSS_DB = 6.0
"""Between plasterboard (3 to 4 dB) and brick (10 dB) at 4 GHz."""
_SPREAD_DB = 4.0
"""By which a link's loss differs from distance and walls: furniture, angles, walls nobody mapped."""
_BUDGET_DB, _BUDGET_SIGMA_DB = 36.0, 6.0
"""Loss beyond that of the first metre at which half of the links are lost: 60 m in line of sight, by
data sheets; the survey's own links say better."""
_BUDGETS_DB = np.arange(15.0, 60.5, 0.5)


def wall_counts(solution: Solution, places: Points, anchors: Points) -> FloatArray:
    """(N, C) walls of the plan that ranges from (N, 2) places to (C, 2) anchors cross."""
    plan = solution.plan
    ends = np.array([wall.ends for wall in plan.walls] if plan else []).reshape(-1, 2, 2)
    return walls_between(ends, places, anchors).astype(np.float64)


def range_variances(walls: FloatArray, settings: PlanningSettings) -> FloatArray:
    """m^2, of ranges that cross so many walls."""
    return np.asarray(settings.sight_sigma_m**2 + walls * settings.wall_sigma_m**2)


def hearing_probability(walls: FloatArray, distances: FloatArray, budget: float) -> FloatArray:
    """0-1, that anything is heard across so many walls and metres."""
    return np.asarray(expit((budget - _loss(walls, distances)) / _SPREAD_DB))


def link_budget(solution: Solution) -> float:
    """Loss (dB) that half of the links bear, by the links that the survey heard and did not hear.

    The most probable value of a logistic model, with what devices of the kind bear as its prior.
    """
    stations = {s.id: s.pose.translation for s in solution.stations if s.pose is not None}
    anchors = {a.id: a.position for a in solution.anchors if a.position is not None}
    badness = np.square((_BUDGETS_DB - _BUDGET_DB) / _BUDGET_SIGMA_DB) / 2.0
    if not stations or not anchors:
        return _BUDGET_DB
    # A survey solved without ranges says nothing of what is heard.
    there = {(k.station, k.anchor) for k in solution.links if k.samples > 0}
    if not there:
        return _BUDGET_DB
    places, targets = np.array(list(stations.values())), np.array(list(anchors.values()))
    heard = np.array([[(s, a) in there for a in anchors] for s in stations])
    distances = np.linalg.norm(places[:, None] - targets[None], axis=2)
    loss = _loss(wall_counts(solution, places, targets), distances)
    margins = (_BUDGETS_DB[:, None, None] - loss) / _SPREAD_DB
    badness -= np.where(heard, log_expit(margins), log_expit(-margins)).sum(axis=(1, 2))
    return float(_BUDGETS_DB[np.argmin(badness)])


def _loss(walls: FloatArray, distances: FloatArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.maximum(distances, 1.0)) + walls * _WALL_LOSS_DB)
