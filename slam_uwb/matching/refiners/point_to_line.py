"""Robust point-to-line ICP, both ways, coarse to fine, for a batch of initial matches at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray
from ...model.settings import MatchingSettings
from ..batch import adjoints, compose, distinct
from ..correspondences import Correspondences, correspondences
from ..index import ScanIndex
from ..lanes import Lanes, ScanPair, both_ways, in_parts, lanes_both_ways
from ..score import score_matches, score_pairs
from .refinement import Refinement

_DAMPING = 0.005  # end walls bring 0.07 of a room's information, noise alone less than 0.007
_CAUCHY_M = 0.05  # loss scale while the match may still be off; registration study, 5
_COARSE_GATES_M = (0.5, 0.3)
_COARSE_SCALE = 0.3  # of the gate: the loss of walls that only happen to lie within it
_COARSE = 3  # every third point is enough to find the basin
_FINE = 2  # every second point, to tell whether it was left
_PROMISING = 0.5  # of the evidence that a hypothesis needs in the end
_LOST_M = 0.3  # of evidence that the fine stage may lose to rounding and to walls that give way
_SETTLED = 2e-2  # m and rad; partners swap at every step, so the last steps of a right match are millimetres
_LEAST_PARTNERS = 3  # residuals that a pose takes
_SHRINK = 0.6
_STEPS, _STEPS_UNTIL_STILL = 6, 30
_LONGEST_STEP_M = 0.5
_STILL = 1e-8  # m and rad; nothing moves any more
_STILL_SHARE = 1e-6  # of the residuals' own scale
_SCALE_FLOOR_M = 1e-9  # noise-free walls fit exactly


def refine_point_to_line(
    target: ScanIndex, source: ScanIndex, initial: FloatArray, settings: MatchingSettings
) -> Refinement:
    """Move poses target_T_source (K, 3) until the points of each scan lie on the walls of the other.

    Stages: every third point within 0.5 and 0.3 m, one way, to reach the basin; then all points
    within `fine_gate_m`, both ways, with a Cauchy loss; at last the loss takes the scale of the
    residuals themselves, so that points without a partner (clutter, doors) lose their pull as the
    walls come together.

    Lines do not know of free space. Where scans share little, what they do share may leave a
    direction to clutter, and the pose slides until walls stand where the other scan looked through.
    No stage may therefore lose evidence: where it would, the pose stays as it was before.

    Between the stages, candidates that have become one and those with the least evidence are
    dropped.

    Returns:
        J <= K refined poses; one has converged if at least three points, which a pose needs, have
        partners, and its last step was shorter than 2 cm and 1 degree or led away from evidence.
    """
    (refined,) = refine_pairs_to_lines([(target, source)], [initial], settings)
    return refined


def refine_pairs_to_lines(
    pairs: Sequence[ScanPair], initial: Sequence[FloatArray], settings: MatchingSettings
) -> list[Refinement]:
    """The same for Q pairs, the fine stage of all of them at once, from poses (K, 3) of each."""
    coarse = [
        _in_basin(target, source, np.array(starts, dtype=np.float64).reshape(-1, 3), settings)
        for (target, source), starts in zip(pairs, initial, strict=True)
    ]
    before = np.concatenate(coarse)
    each = [pair for pair, poses in zip(pairs, coarse, strict=True) for _ in poses]
    fine = polish_pairs(each, before, settings)
    scores = score_pairs(each, np.stack([before, fine.poses], axis=1), settings, _FINE)
    kept, gained = np.array([score.evidence for score in scores]).reshape(-1, 2).T
    lost = gained < kept - _LOST_M
    poses, converged = _where(lost, before, fine.poses), fine.converged | lost
    ends = np.cumsum([len(part) for part in coarse])[:-1]
    return [
        Refinement(*of_pair, np.full(len(of_pair[0]), len(_COARSE_GATES_M) + _STEPS))
        for of_pair in zip(np.split(poses, ends), np.split(converged, ends), strict=True)
    ]


def _in_basin(
    target: ScanIndex, source: ScanIndex, starts: FloatArray, settings: MatchingSettings
) -> FloatArray:
    """(J, 3) what the coarse stage makes of the poses target_T_source (K, 3), the most evidence first."""
    poses = starts
    for gate in _COARSE_GATES_M:
        rows = correspondences(target, source, poses, gate=gate, stride=_COARSE)
        poses = compose(poses, _step(*normal_equations(rows, _COARSE_SCALE * gate)))
    both = np.concatenate([starts, poses])
    evidence = score_matches(target, source, both, settings, _COARSE).evidence
    before, after = evidence[: len(starts)], evidence[len(starts) :]
    poses, evidence = _where(after < before, starts, poses), np.maximum(before, after)
    # What confirms next to nothing now confirms nothing in the end; right matches have twice that.
    least = min(_PROMISING * settings.min_evidence_m, evidence.max(initial=-np.inf))
    poses, evidence = poses[evidence >= least], evidence[evidence >= least]
    return np.asarray(poses[distinct(poses, evidence, settings.hypotheses)])


def _where(chosen: NDArray[np.bool_], poses: FloatArray, others: FloatArray) -> FloatArray:
    """(K, 3) the poses that are chosen (K,), the others elsewhere."""
    return np.where(chosen[:, None], poses, others)


def polish(
    target: ScanIndex,
    source: ScanIndex,
    poses: FloatArray,
    settings: MatchingSettings,
    *,
    until_still: bool = False,
) -> Refinement:
    """The fine stage alone, for poses already within about 0.2 m and 5 degrees.

    `until_still` goes on, with partners found exactly, until nothing moves: the result then does
    not depend on where in the basin it started.
    """
    starts = np.array(poses, dtype=np.float64).reshape(1, -1, 3)
    pair = lanes_both_ways([(target, source)])
    return _polished(pair, starts, settings, until_still=until_still).of_pair(0)


def polish_pairs(
    pairs: Sequence[ScanPair],
    poses: FloatArray,
    settings: MatchingSettings,
    *,
    until_still: bool = False,
) -> Refinement:
    """The fine stage of Q pairs at once, each from its pose target_T_source (Q, 3)."""
    found = _Polished.empty((len(pairs), 1))
    for part in in_parts(len(pairs)):
        both = lanes_both_ways(pairs[part])
        ended = _polished(both, poses[part, None], settings, until_still=until_still)
        for values, new in zip(found, ended, strict=True):
            values[part] = new
    return Refinement(found.poses[:, 0], found.converged[:, 0], found.iterations[:, 0])


class _Polished(NamedTuple):
    """`Refinement` of the K poses of each of Q pairs."""

    poses: FloatArray
    converged: NDArray[np.bool_]
    iterations: NDArray[np.int64]

    @classmethod
    def empty(cls, shape: tuple[int, ...]) -> _Polished:
        """Of so many pairs and poses (Q, K), to be filled."""
        return cls(np.zeros((*shape, 3)), np.zeros(shape, dtype=bool), np.zeros(shape, np.int64))

    def of_pair(self, number: int) -> Refinement:
        """That of one of the pairs."""
        return Refinement(self.poses[number], self.converged[number], self.iterations[number])


def _polished(
    pairs: Lanes, poses: FloatArray, settings: MatchingSettings, *, until_still: bool
) -> _Polished:
    """The fine stage of Q pairs in 2 Q lanes from poses target_T_source (Q, K, 3).

    What becomes of a pair does not depend on the others: each ends when nothing of it moves.
    """
    found = _Polished.empty(poses.shape[:-1])
    left = np.arange(len(poses))
    steps = _STEPS_UNTIL_STILL if until_still else _STEPS
    for iteration in range(steps):
        scale = _fine_scale(iteration)
        rows = correspondences(
            pairs, pairs, both_ways(poses), gate=settings.fine_gate_m, exact=until_still
        )
        used_scale = np.maximum(scale, _own_scale(rows))
        equations = normal_equations(rows, np.concatenate([used_scale, used_scale]))
        step = _step(*_summed(poses, *equations))
        poses = compose(poses, step)
        # Still under a scale that is yet to shrink is not the end.
        still = _are_still(step, used_scale) & (used_scale > scale)
        ended = np.asarray(still.all(axis=(1, 2)) | (iteration == steps - 1))
        if not ended.any():
            continue
        # Where nothing pairs, nothing moves: that is no match.
        partners = np.count_nonzero(rows.weight[: len(poses)], axis=-1)
        converged = (partners >= _LEAST_PARTNERS) & (np.abs(step) < _SETTLED).all(axis=-1)
        found.poses[left[ended]] = poses[ended]
        found.converged[left[ended]] = converged[ended]
        found.iterations[left[ended]] = iteration + 1
        if ended.all():
            break
        left, poses, pairs = left[~ended], poses[~ended], pairs.of(np.tile(~ended, 2))
    return found


def _fine_scale(iteration: int) -> float:
    """Scale of the loss, m, below which it does not go at a step of the fine stage.

    It shrinks step by step: at once, the many points of one wall would set it, and the few that
    hold the other direction would be outliers before they have settled. Later it may shrink faster:
    only exact scans still follow.
    """
    return _CAUCHY_M * _SHRINK ** (iteration + max(0, iteration - _STEPS))


def _are_still(step: FloatArray, scale: FloatArray) -> NDArray[np.bool_]:
    """(Q, K, 1) whether a step (Q, K, 3) is nothing, by the scale (Q, K, 1) of the residuals."""
    moved = np.abs(step).max(axis=-1, keepdims=True)
    return np.asarray(moved < np.maximum(_STILL, _STILL_SHARE * scale))


def _step(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(..., 3) steps in the source's axes of normal equations (..., 3, 3), (..., 3)."""
    return limited(damped_step(hessian, gradient), _LONGEST_STEP_M)


def _summed(
    poses: FloatArray, hessians: FloatArray, gradients: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Hessians (Q, K, 3, 3) and gradients (Q, K, 3) in the source's axes, from those of 2 Q lanes."""
    # Seen from the target: residual of inverse(T); d inverse = -Ad(T) d in its axes.
    adjoint, count = adjoints(poses), len(poses)
    transposed = np.swapaxes(adjoint, -1, -2)
    hessian = hessians[:count] + transposed @ hessians[count:] @ adjoint
    return hessian, gradients[:count] - (transposed @ gradients[count:, ..., None])[..., 0]


def normal_equations(
    rows: Correspondences, loss_scale: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Hessians (..., K, 3, 3) and gradients (..., K, 3) under a Cauchy loss, of one scale or scales (K, 1), m."""
    loss = rows.residual / loss_scale
    loss *= loss
    loss += 1.0
    weight = np.divide(rows.weight, loss, out=loss)
    weighted = np.swapaxes(rows.jacobian, -1, -2) * weight[..., None, :]
    return weighted @ rows.jacobian, (weighted @ rows.residual[..., None])[..., 0]


def damped_step(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(..., 3) Gauss-Newton steps of normal equations (..., 3, 3), (..., 3), in (x, y, theta).

    Damping keeps a direction that only the noise of normals holds (a corridor's axis) where it is.
    """
    damped = hessian.copy()
    diagonal = damped.reshape(-1, 9)[:, ::4]
    damping = _DAMPING * diagonal
    damping[:, :2] = damping[:, :1] + damping[:, 1:2]
    diagonal += damping
    diagonal += 1e-12
    return np.asarray(-np.linalg.solve(damped, gradient[..., None])[..., 0])


def limited(steps: FloatArray, longest: float) -> FloatArray:
    """The steps (..., 3), those longer than `longest` metres shortened."""
    length = np.maximum(np.hypot(steps[..., 0], steps[..., 1]), 1e-12)
    return np.asarray(steps * np.minimum(1.0, longest / length)[..., None])


def _own_scale(rows: Correspondences) -> FloatArray:
    """(Q, K, 1) Cauchy scale of Q pairs from the median absolute residual within the gate, at most the coarse one.

    From the residuals of 2 Q lanes (2 Q, K, N), both ways.
    """
    lanes, poses, points = rows.residual.shape
    both = (2, lanes // 2, poses, points)
    sizes = np.concatenate(np.abs(rows.residual).reshape(both), axis=-1)
    paired = np.concatenate((rows.weight > 0.0).reshape(both), axis=-1)
    sizes[~paired] = np.inf
    sizes.sort(axis=-1)
    count = np.count_nonzero(paired, axis=-1)[..., None]
    low = np.take_along_axis(sizes, np.maximum(count - 1, 0) // 2, axis=-1)
    high = np.take_along_axis(sizes, np.minimum(count // 2, 2 * points - 1), axis=-1)
    middle = np.where(count == 0, _CAUCHY_M, 0.5 * (low + high))
    return np.asarray(np.clip(2.0 * 1.4826 * middle, _SCALE_FLOOR_M, _CAUCHY_M))
