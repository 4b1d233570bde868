"""One step of the whole problem: everything linear at an estimate, eliminated by GTSAM at once."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from ..model.errors import SolverError
from . import factors
from .feeding import Ends, feed_rows, range_ends
from .ranges import RangeCosts, WeighedRanges
from .variables import Indices, Places, Variables, to_values


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Everything somewhere, and what that costs."""

    values: gtsam.Values
    places: Places
    """The same, in the order of the ranges' table."""
    ranges: RangeCosts
    cost: float
    """Negative log likelihood of matches, priors and ranges."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What is to be minimised: its keys are looked up once, not at every step."""

    fixed: gtsam.NonlinearFactorGraph
    """Matches and priors."""
    ranges: WeighedRanges
    indices: Indices
    ends: Ends
    stations: list[int]
    """Keys, in the order of the table; so are the others."""
    anchors: list[int]
    lost: list[int]
    """Of the stations that nothing but ranges holds."""
    offset: float
    """m, where there are no ranges that tell it."""

    @classmethod
    def of(
        cls,
        fixed: gtsam.NonlinearFactorGraph,
        ranges: WeighedRanges,
        start: Variables,
        indices: Indices,
    ) -> Problem:
        """The minimum of the fixed factors and the costs of the ranges is sought."""
        table = ranges.table
        stations = {name: factors.X(indices.stations[name]) for name in table.stations}
        anchors = [factors.L(indices.anchors[name]) for name in table.anchors]
        lost = [key for name, key in stations.items() if name in table.lost]
        ends = range_ends(table, indices)
        return cls(fixed, ranges, indices, ends, [*stations.values()], anchors, lost, start.offset)

    def start(self, variables: Variables) -> Estimate:
        """The estimate with these variables."""
        return self.at(to_values(variables, self.indices, with_offset=bool(self.ends)))

    def at(self, values: gtsam.Values) -> Estimate:
        """The estimate that GTSAM has.

        Raises:
            SolverError: its cost is not finite.
        """
        places = self._places(values)
        ranges = self.ranges.expand(places)
        cost = float(self.fixed.error(values) + ranges.costs.sum())
        # GTSAM returns its start without complaint where a measurement is not a number.
        if not math.isfinite(cost):
            raise SolverError("the cost is not finite: a match, range or prior is not a number")
        return Estimate(values, places, ranges, cost)

    def _places(self, values: gtsam.Values) -> Places:
        poses = np.empty((len(self.stations), 3))
        # GTSAM hands them over by key.
        poses[np.argsort(self.stations)] = gtsam.utilities.extractPose2(values)
        anchors = [values.atPoint2(key) for key in self.anchors]
        offsets = np.full(len(anchors) + 1, self.offset)
        if self.ends:
            own = [values.atDouble(factors.D(gtsam.symbolIndex(key))) for key in self.anchors]
            offsets[:] = [*own, values.atDouble(factors.OFFSET_KEY)]
        return Places(poses, np.array(anchors).reshape(-1, 2), offsets)

    def linear(self, here: Estimate, trust: float, safe: bool) -> gtsam.GaussianFactorGraph:
        """Everything, linear at an estimate; arguments as `linear_ranges`."""
        linear = self.fixed.linearize(here.values)
        linear.push_back(self.linear_ranges(here, trust, safe))
        return linear

    def linear_ranges(self, here: Estimate, trust: float, safe: bool) -> gtsam.GaussianFactorGraph:
        """Ranges and leashes, linear at an estimate.

        Leashes are priors at the present place of what only ranges hold: the damping that a step needs.
        They follow the estimate, so they bend no result. An anchor near the line of its stations needs
        them: Gauss-Newton jumps across the line for ever.

        Args:
            here: the estimate.
            trust: m, sigma of the leashes.
            safe: whether ranges get a curvature that their cost nowhere exceeds.
        """
        linear, unit = gtsam.GaussianFactorGraph(), gtsam.noiseModel.Unit.Create(1)
        curvatures = self.ranges.let_in(here.ranges, safe)
        # Tens of thousands in a large survey: the loop does nothing but hand them over.
        for row in feed_rows(self.ranges.table, here.ranges, curvatures, here.places, self.ends):
            linear.add(*row, unit)
        plane, still, unit = np.eye(2, 3) / trust, np.zeros(2), gtsam.noiseModel.Unit.Create(2)
        for key in self.anchors:
            linear.add(key, plane[:, :2], still, unit)
        for key in self.lost:
            linear.add(key, plane, still, unit)
        return linear


def solve_linear(
    linear: gtsam.GaussianFactorGraph,
    bends: Sequence[gtsam.HessianFactor],
    ordering: gtsam.Ordering,
    indices: Indices,
) -> tuple[gtsam.VectorValues, bool]:
    """The step to the minimum of a linear problem, with the bends where they leave it definite.

    Returns:
        The step, and whether bends are of use.

    Raises:
        SolverError: the measurements do not determine something.
    """
    if bends:
        whole = gtsam.GaussianFactorGraph()
        whole.push_back(linear)
        for bend in bends:
            whole.push_back(bend)
        try:
            return whole.optimize(ordering), True
        except RuntimeError:
            pass  # An anchor is held only as well as the poses that see it.
    try:
        return linear.optimize(ordering), not bends
    except RuntimeError as error:
        raise solver_error(error, indices) from error


def solver_error(error: RuntimeError, indices: Indices) -> SolverError:
    """GTSAM's complaint in the words of the survey."""
    symbol = re.search(r"Symbol: ([xlbd]\d+)", str(error))
    if "Indeterminate" in str(error) and symbol:
        name = indices.name(symbol[1])
        return SolverError(f"the measurements do not determine {name}")
    return SolverError(f"the solver failed: {error}")
