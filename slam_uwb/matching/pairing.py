"""Every point of one scan with the point of another that lies nearest to it, for many poses at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray
from .index import ScanIndex
from .lanes import Lanes


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """N points of the source and their partners on the target at K poses target_T_source.

    Of L `Lanes`, arrays (L, K, N) instead of (K, N).
    """

    partner: NDArray[np.int32]
    """(K, N) index of the target's point."""
    x: FloatArray
    """(K, N) m, the source's points in the target's table axes."""
    y: FloatArray
    across: FloatArray
    """(K, N) m, residual along the partner's normal."""
    squared: FloatArray
    """(K, N) m^2, squared distance of the partner."""
    normal_x: FloatArray
    """(K, N) the partner's normal in the source's axes."""
    normal_y: FloatArray
    facing: FloatArray
    """(K, N) cosine between the normals of both; 0 where one of them has none."""


def pair_points(
    target: ScanIndex | Lanes,
    source: ScanIndex | Lanes,
    poses: FloatArray,
    *,
    stride: int = 1,
    exact: bool = False,
) -> Pairing:
    """Partners of every `stride`-th point of the source at poses target_T_source (K, 3).

    `Lanes` stand for both, with poses (L, K, 3) target_T_source.

    By look-up in a table of 0.1 m cells, so nearly the nearest; `exact` by search, at three times
    the time.
    """
    ca, sa = np.cos(target.table_turn), np.sin(target.table_turn)
    turned = poses[..., 2:3] - target.table_turn
    c, s = np.cos(turned), np.sin(turned)
    points_x, points_y, normals_x, normals_y = source.columns[..., ::stride]
    x = c * points_x
    x -= s * points_y
    x += ca * poses[..., 0:1] + sa * poses[..., 1:2]
    y = s * points_x
    y += c * points_y
    y += ca * poses[..., 1:2] - sa * poses[..., 0:1]
    partner = target.nearest_by_search(x, y) if exact else target.nearest_in_table(x, y)
    target_x, target_y, target_nx, target_ny = target.table_columns
    dx, dy = target_x.take(partner), target_y.take(partner)
    np.subtract(x, dx, out=dx)
    np.subtract(y, dy, out=dy)
    nx, ny = target_nx.take(partner), target_ny.take(partner)
    across = nx * dx
    across += ny * dy
    dx *= dx
    dy *= dy
    dx += dy
    normal_x, normal_y = c * nx, c * ny
    normal_x += s * ny
    normal_y -= s * nx
    facing = normal_x * normals_x
    facing += normal_y * normals_y
    return Pairing(
        partner=partner, x=x, y=y, across=across, squared=dx, normal_x=normal_x, normal_y=normal_y,
        facing=facing,
    )  # fmt: skip
