"""Points of one scan against the walls of another that face the same way: what refiners minimise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .index import ScanIndex
from .lanes import Lanes
from .pairing import pair_points

_SAME_FACE = 0.5  # least cosine between the normals of partners


class Correspondences(NamedTuple):
    """N source points against the target's walls at K poses target_T_source; (L, K, N) of L `Lanes`."""

    residual: FloatArray
    """(K, N) m, along the target's normals."""
    jacobian: FloatArray
    """(K, N, 3) its derivatives by a motion (x, y, theta) in the source's axes."""
    weight: FloatArray
    """(K, N) m of wall; zero where no reliable wall that faces the same way lies within the gate."""
    partner: NDArray[np.int32]
    """(K, N) index of the target's point."""


def correspondences(
    target: ScanIndex | Lanes,
    source: ScanIndex | Lanes,
    poses: FloatArray,
    *,
    gate: float,
    stride: int = 1,
    exact: bool = False,
) -> Correspondences:
    """Every `stride`-th source point against the walls within `gate` metres at poses target_T_source (K, 3).

    `Lanes` stand for both, as in `pair_points`.
    """
    pairing = pair_points(target, source, poses, stride=stride, exact=exact)
    points_x, points_y = source.columns[:2, ..., ::stride]
    # Rows are kept component by component: products over the points run along memory.
    jacobian = np.empty((*poses.shape[:-1], 3, points_x.shape[-1]))
    jacobian[..., 0, :], jacobian[..., 1, :] = pairing.normal_x, pairing.normal_y
    jacobian[..., 2, :] = pairing.normal_y * points_x
    jacobian[..., 2, :] -= pairing.normal_x * points_y
    # The two faces of a wall lie within the gate; normals that face apart tell them from each other.
    close = (pairing.squared < gate * gate) & (pairing.facing > _SAME_FACE)
    close &= target.reliable.take(pairing.partner)
    weight = close * source.lengths[..., ::stride]
    return Correspondences(pairing.across, np.swapaxes(jacobian, -1, -2), weight, pairing.partner)


def partner_count(
    target: ScanIndex, source: ScanIndex, poses: FloatArray, gate: float
) -> NDArray[np.intp]:
    """(K,) points of the source within `gate` metres of a wall of the target that faces the same way."""
    weight = correspondences(target, source, poses, gate=gate).weight
    return np.asarray(np.count_nonzero(weight, axis=1))
