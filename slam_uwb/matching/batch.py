"""Many poses at once: rows (x, y, theta) of arrays (K, 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray

_SAME_M, _SAME_RAD = 0.15, 0.07  # poses closer than this are one


def compose(poses: FloatArray, steps: FloatArray) -> FloatArray:
    """(..., 3) ``pose @ step`` for each row."""
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    x = poses[..., 0] + c * steps[..., 0] - s * steps[..., 1]
    y = poses[..., 1] + s * steps[..., 0] + c * steps[..., 1]
    return np.stack([x, y, poses[..., 2] + steps[..., 2]], axis=-1)


def invert(poses: FloatArray) -> FloatArray:
    """(..., 3) inverse of each row."""
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    x = -c * poses[..., 0] - s * poses[..., 1]
    y = s * poses[..., 0] - c * poses[..., 1]
    return np.stack([x, y, -poses[..., 2]], axis=-1)


def adjoints(poses: FloatArray) -> FloatArray:
    """(..., 3, 3) adjoint of each row; see `Pose2.adjoint`."""
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    found = np.zeros((*poses.shape, 3))
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = c, -s, poses[..., 1]
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = s, c, -poses[..., 0]
    found[..., 2, 2] = 1.0
    return found


def transform(poses: FloatArray, points: FloatArray) -> FloatArray:
    """(K, N, 2) points (N, 2) mapped by each row."""
    c, s = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
    x = c * points[:, 0] - s * points[:, 1] + poses[:, 0:1]
    y = s * points[:, 0] + c * points[:, 1] + poses[:, 1:2]
    return np.stack([x, y], axis=-1)


def wrapped(angles: FloatArray) -> FloatArray:
    """The angles (...,) brought into [-pi, pi) rad."""
    return np.asarray(np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi)


def near(poses: FloatArray, metres: float, radians: float) -> NDArray[np.bool_]:
    """(K, K) which of the poses are nearer to each other than both limits."""
    x, y, theta = poses.T[:, :, None] - poses.T[:, None, :]
    return np.asarray((np.hypot(x, y) < metres) & (np.abs(wrapped(theta)) < radians))


def distinct(poses: FloatArray, score: FloatArray, count: int) -> list[int]:
    """Indices of up to `count` poses, the highest score first, leaving out those that equal a better one."""
    order = np.argsort(-score, kind="stable")
    return first_of_each(order, near(poses, _SAME_M, _SAME_RAD), count)


def first_of_each(order: NDArray[np.intp], same: NDArray[np.bool_], count: int) -> list[int]:
    """Up to `count` indices in their order, leaving out those that are the same (K, K) as one before."""
    free, other = np.ones(len(same), dtype=bool), ~same
    kept: list[int] = []
    for index in order:
        if free[index]:
            kept.append(int(index))
            free &= other[index]
            if len(kept) == count:
                break
    return kept
