"""Points that ranges place, all at once: damped Newton at fixed tags, every point eliminated by itself.

Each sought point has a place and an offset of its links; the offsets are tied to a common one, which
is all that points share. So the normal equations are a 3 x 3 block a point and one scalar. Used to
refine candidate places (uncoupled: each its own problem) and to weigh models of the links by their
Laplace evidence (coupled).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from ..model.link_law import LinkDensity
from ..model.survey import RangeOffset

MAX_ITERATIONS = 40
COLD_DAMPING, WARM_DAMPING = 1e-4, 1e-9
"""Of the first step: from anywhere, and from where a fit of nearly the same problem ended."""
LONGEST_STEP = 1.0
"""m, of a point by itself: beyond, what the cost's curvature is here says nothing."""
FAILED_DAMPING = 1e-2
"""At least, after a step that made things worse: less would hardly shorten the next."""
ROUNDING = 1e-10
"""nats. The last steps change the cost by less than it is rounded by, and places still by a micrometre."""
LEAST_CURVATURE = 0.02
"""Of a link, as a share of that in line of sight (joint study, 7): Newton needs some."""


@dataclass(frozen=True, slots=True, eq=False)
class RangeView:
    """From where A sought points are seen: up to N known points each, padded with infinite sigmas."""

    points: FloatArray
    """(A, N, 2) m."""
    rises: FloatArray
    """(A, N) m, sought above known."""
    distances: FloatArray
    """(A, N) m, slant, offsets included."""
    sigmas: FloatArray
    """(A, N) m."""

    def residuals(self, places: Points, offsets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(A, N) measured minus offset minus predicted; (A, N, 2) derivatives of the prediction by the place."""
        delta = places[:, None, :] - self.points
        slant = np.sqrt(np.einsum("ani,ani->an", delta, delta) + self.rises**2)
        return self.distances - offsets[:, None] - slant, delta / np.maximum(slant, 1e-9)[..., None]


@dataclass(frozen=True, slots=True, eq=False)
class RangeFit:
    """Places with the offsets that go with them."""

    places: Points
    """(A, 2) m."""
    offsets: FloatArray
    """(A,) m, of each point's links."""
    common: float
    """m, of all links; the prior's mean where points are not coupled."""
    costs: FloatArray
    """(A,) negative log posterior of each point, up to a constant."""
    blocks: FloatArray
    """(A, 3, 3) Hessian of each point's place and offset."""

    def some(self, rows: Sequence[int]) -> RangeFit:
        """Some of the points, in that order."""
        rows = list(rows)
        return RangeFit(
            self.places[rows], self.offsets[rows], self.common, self.costs[rows], self.blocks[rows]
        )


@dataclass(frozen=True, slots=True)
class OffsetPrior:
    """Offsets of the links of single points about a common one."""

    common: RangeOffset
    own_sigma: float
    """m."""


def fit_ranges(
    view: RangeView,
    density: LinkDensity,
    prior: OffsetPrior,
    places: Points,
    floor: float,
    coupled: bool,
    start: RangeFit | None = None,
    still: float = 1e-8,
) -> RangeFit:
    """Nearest minimum to `places` (A, 2).

    Args:
        view: what is seen.
        density: of the links' errors, (A, N).
        prior: of the offsets.
        places: where to start.
        floor: least curvature of a link, 1/m^2.
        coupled: whether the points share their common offset; else each is a problem by itself.
        start: offsets to start from.
        still: m, ends where no step is longer.
    """
    common = prior.common.mean if start is None else start.common
    offsets = np.full(len(places), common) if start is None else start.offsets
    problem = _Problem(view, density, prior, coupled, floor)
    state = np.column_stack([places, offsets])
    here = problem.expand(state, common)
    damping = np.full(len(places), COLD_DAMPING if start is None else WARM_DAMPING)
    for _ in range(MAX_ITERATIONS):
        step, common_step = _step(problem, here, state, common, damping)
        trial, trial_common = state + step, common + common_step
        there = problem.expand(trial, trial_common)
        better = there.costs <= here.costs + ROUNDING
        if coupled:
            before = _total(here.costs, common, prior)
            better[:] = _total(there.costs, trial_common, prior) <= before + ROUNDING
            common = trial_common if better.all() else common
        state = np.where(better[:, None], trial, state)
        here = here.replaced(better, there)
        less, more = np.maximum(damping * 0.1, 1e-12), np.maximum(damping * 10.0, FAILED_DAMPING)
        damping = np.where(better, less, np.minimum(more, 1e9))
        if np.abs(step).max() < still:
            break
    return RangeFit(state[:, :2], state[:, 2], common, here.costs, here.blocks)


@dataclass(frozen=True, slots=True, eq=False)
class _Expansion:
    """The cost of every point to second order in its place and offset."""

    costs: FloatArray
    """(A,)"""
    gradient: FloatArray
    """(A, 3)"""
    blocks: FloatArray
    """(A, 3, 3) Hessian with the least curvature."""
    exact: FloatArray
    """(A, 3, 3) Hessian as it is."""

    def replaced(self, chosen: NDArray[np.bool_], other: _Expansion) -> _Expansion:
        """This one, of the chosen points the other one."""
        if chosen.all():
            return other
        matrices = chosen[:, None, None]
        return _Expansion(
            np.where(chosen, other.costs, self.costs),
            np.where(chosen[:, None], other.gradient, self.gradient),
            np.where(matrices, other.blocks, self.blocks),
            np.where(matrices, other.exact, self.exact),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """What the points are fitted to."""

    view: RangeView
    density: LinkDensity
    prior: OffsetPrior
    coupled: bool
    floor: float
    """1/m^2"""

    @property
    def own_variance(self) -> float:
        """m^2, of the offset of one point about the common one."""
        common = 0.0 if self.coupled else self.prior.common.sigma**2
        return self.prior.own_sigma**2 + common

    def expand(self, state: FloatArray, common: float) -> _Expansion:
        """At places and offsets (A, 3) and the common offset, m."""
        residuals, directions = self.view.residuals(state[:, :2], state[:, 2])
        costs, slope, curvature = self.density.expand(residuals)
        jacobian = np.concatenate([directions, np.ones((*residuals.shape, 1))], axis=2)
        turned = np.swapaxes(jacobian, 1, 2)
        gradient = -(turned @ slope[..., None])[..., 0]
        variance, off = self.own_variance, state[:, 2] - common
        gradient[:, 2] += off / variance
        floored = np.maximum(curvature, self.floor * self.density.weights)
        blocks = turned @ (floored[..., None] * jacobian)
        exact = turned @ (curvature[..., None] * jacobian)
        # A range bends as well: its second derivative is (1 - d d^T) by its length.
        slant = self.view.distances - state[:, 2:] - residuals
        bend = slope / np.maximum(slant, 1e-9)
        exact[:, :2, :2] += turned[:, :2] @ (bend[..., None] * directions)
        exact[:, [0, 1], [0, 1]] -= bend.sum(axis=1)[:, None]
        for hessian in (blocks, exact):
            hessian[:, 2, 2] += 1.0 / variance
            # A place straight below all that see it: 10 m instead of singular.
            hessian[:, [0, 1], [0, 1]] += 1e-2
        return _Expansion(costs.sum(axis=1) + 0.5 * off**2 / variance, gradient, blocks, exact)


def log_evidence_cost(fit: RangeFit, prior: OffsetPrior) -> float:
    """Negative Laplace evidence of coupled points: cost and half the log determinant, less the prior's."""
    count = len(fit.places)
    total = _total(fit.costs, fit.common, prior)
    schur = _common_information(fit.blocks, prior)
    determinant = np.linalg.slogdet(fit.blocks)[1].sum() + np.log(schur)
    normaliser = count * np.log(prior.own_sigma) + np.log(prior.common.sigma)
    return float(total + 0.5 * determinant + normaliser)


def common_sigma(fit: RangeFit, prior: OffsetPrior) -> float:
    """m, posterior standard deviation of the common offset."""
    return float(_common_information(fit.blocks, prior) ** -0.5)


def _total(costs: FloatArray, common: float, prior: OffsetPrior) -> float:
    return float(costs.sum() + 0.5 * ((common - prior.common.mean) / prior.common.sigma) ** 2)


def _newton_blocks(exact: FloatArray) -> FloatArray:
    """The Hessians (A, 3, 3), and where one is indefinite its curvatures taken as positive.

    Along a negative curvature the step is then as long as along a positive one, but downhill; the
    blocks with the least curvature of every link would creep there.
    """
    values, axes = np.linalg.eigh(exact)
    if (values[:, 0] > 0.0).all():
        return exact.copy()
    positive = np.maximum(np.abs(values), 1.0)
    turned = (axes * positive[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return np.asarray(np.where((values[:, 0] > 0.0)[:, None, None], exact, turned))


def _step(
    problem: _Problem, here: _Expansion, state: FloatArray, common: float, damping: FloatArray
) -> tuple[FloatArray, float]:
    """(A, 3) Newton step of the points, and that of the common offset."""
    prior, gradient = problem.prior, here.gradient
    damped = _newton_blocks(here.exact)
    diagonal = np.einsum("aii->ai", damped)
    diagonal += damping[:, None] * diagonal
    if not problem.coupled:
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-12))), 0.0
    inverse = np.linalg.inv(damped)
    pull = prior.own_sigma**-2
    right = (common - prior.common.mean) / prior.common.sigma**2
    right += pull * (common - state[:, 2]).sum()
    information = prior.common.sigma**-2 + pull * len(state)
    information -= pull**2 * inverse[:, 2, 2].sum()
    right += pull * np.einsum("ai,ai->", inverse[:, 2], gradient)
    common_step = -right / information
    gradient = gradient - pull * common_step * np.array([0.0, 0.0, 1.0])
    return np.asarray(-np.einsum("aij,aj->ai", inverse, gradient)), float(common_step)


def _common_information(blocks: FloatArray, prior: OffsetPrior) -> float:
    pull = prior.own_sigma**-2
    inverse = np.linalg.inv(blocks)
    information = prior.common.sigma**-2 + pull * len(blocks) - pull**2 * inverse[:, 2, 2].sum()
    return float(information)
