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

from ..model.geometry import FloatArray, Points
from ..model.link_law import LinkDensity
from ..model.survey import RangeOffset

MAX_ITERATIONS = 40
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
    state = np.column_stack([places, offsets])
    costs = _cost(view, density, prior, state, common, coupled)
    damping = np.full(len(places), 1e-4)
    for _ in range(MAX_ITERATIONS):
        gradient, blocks, exact = _expand(view, density, prior, state, common, coupled, floor)
        newton = _newton_blocks(exact, blocks, _own_variance(prior, coupled))
        step, common_step = _step(gradient, newton, prior, state, common, coupled, damping)
        trial, trial_common = state + step, common + common_step
        trial_costs = _cost(view, density, prior, trial, trial_common, coupled)
        better = trial_costs <= costs + ROUNDING
        if coupled:
            before, after = _total(costs, common, prior), _total(trial_costs, trial_common, prior)
            total = after <= before + ROUNDING
            better = np.full(len(places), total)
            common = trial_common if total else common
        state = np.where(better[:, None], trial, state)
        costs = np.where(better, trial_costs, costs)
        damping = np.clip(np.where(better, damping * 0.1, damping * 10.0), 1e-12, 1e9)
        if np.abs(step).max() < still:
            break
    _, blocks, _ = _expand(view, density, prior, state, common, coupled, floor)
    return RangeFit(state[:, :2], state[:, 2], common, costs, blocks)


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


def _own_variance(prior: OffsetPrior, coupled: bool) -> float:
    return prior.own_sigma**2 + (0.0 if coupled else prior.common.sigma**2)


def _cost(
    view: RangeView, density: LinkDensity, prior: OffsetPrior, state: FloatArray, common: float,
    coupled: bool,
) -> FloatArray:  # fmt: skip
    residuals, _ = view.residuals(state[:, :2], state[:, 2])
    own = 0.5 * (state[:, 2] - common) ** 2 / _own_variance(prior, coupled)
    return np.asarray(density.costs(residuals).sum(axis=1) + own)


def _total(costs: FloatArray, common: float, prior: OffsetPrior) -> float:
    return float(costs.sum() + 0.5 * ((common - prior.common.mean) / prior.common.sigma) ** 2)


def _expand(
    view: RangeView, density: LinkDensity, prior: OffsetPrior, state: FloatArray, common: float,
    coupled: bool, floor: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """(A, 3) gradient by place and offset and (A, 3, 3) Hessians: with the least curvature, and as it is."""
    residuals, directions = view.residuals(state[:, :2], state[:, 2])
    _, slope, curvature = density.expand(residuals)
    jacobian = np.concatenate([directions, np.ones((*residuals.shape, 1))], axis=2)
    gradient = -np.einsum("an,ani->ai", slope, jacobian)
    variance = _own_variance(prior, coupled)
    gradient[:, 2] += (state[:, 2] - common) / variance
    floored = np.maximum(curvature, floor * density.weights)
    blocks = np.swapaxes(jacobian, 1, 2) @ (floored[..., None] * jacobian)
    exact = np.swapaxes(jacobian, 1, 2) @ (curvature[..., None] * jacobian)
    # A range bends as well: its second derivative is (1 - d d^T) by its length.
    slant = view.distances - state[:, 2:] - residuals
    bend = slope / np.maximum(slant, 1e-9)
    exact[:, :2, :2] += np.swapaxes(directions, 1, 2) @ (bend[..., None] * directions)
    exact[:, [0, 1], [0, 1]] -= bend.sum(axis=1)[:, None]
    for hessian in (blocks, exact):
        hessian[:, 2, 2] += 1.0 / variance
        # A place straight below all that see it: 10 m instead of singular.
        hessian[:, [0, 1], [0, 1]] += 1e-2
    return gradient, blocks, exact


def _newton_blocks(exact: FloatArray, blocks: FloatArray, own_variance: float) -> FloatArray:
    """The exact Hessians (A, 3, 3) where the ranges alone hold a point, else those with the least curvature.

    Exact ones end in four steps where the others take thirty.
    """
    ranges = exact.copy()
    ranges[:, 2, 2] -= 1.0 / own_variance
    held = np.linalg.eigvalsh(ranges)[:, 0] > 0.0
    return np.asarray(np.where(held[:, None, None], exact, blocks))


def _step(
    gradient: FloatArray, blocks: FloatArray, prior: OffsetPrior, state: FloatArray, common: float,
    coupled: bool, damping: FloatArray,
) -> tuple[FloatArray, float]:  # fmt: skip
    """(A, 3) Newton step of the points, and that of the common offset."""
    damped = blocks.copy()
    diagonal = np.einsum("aii->ai", damped)
    diagonal += damping[:, None] * diagonal
    if not coupled:
        return np.asarray(-np.linalg.solve(damped, gradient[..., None])[..., 0]), 0.0
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
