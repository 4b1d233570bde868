"""Many poses at once: rows (x, y, theta) of arrays (K, 3)."""

from __future__ import annotations

import numpy as np

from ..model.geometry import FloatArray

_SAME_M, _SAME_RAD = 0.15, 0.07  # poses closer than this are one


def compose(poses: FloatArray, steps: FloatArray) -> FloatArray:
    """(K, 3) ``pose @ step`` for each row."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack([
        poses[:, 0] + c * steps[:, 0] - s * steps[:, 1],
        poses[:, 1] + s * steps[:, 0] + c * steps[:, 1],
        poses[:, 2] + steps[:, 2],
    ])  # fmt: skip


def invert(poses: FloatArray) -> FloatArray:
    """(K, 3) inverse of each row."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack([
        -c * poses[:, 0] - s * poses[:, 1],
        s * poses[:, 0] - c * poses[:, 1],
        -poses[:, 2],
    ])  # fmt: skip


def adjoints(poses: FloatArray) -> FloatArray:
    """(K, 3, 3) adjoint of each row; see `Pose2.adjoint`."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, -s, poses[:, 1]], [s, c, -poses[:, 0]], [zero, zero, one]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def transform(poses: FloatArray, points: FloatArray) -> FloatArray:
    """(K, N, 2) points (N, 2) mapped by each row."""
    c, s = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
    x = c * points[:, 0] - s * points[:, 1] + poses[:, 0:1]
    y = s * points[:, 0] + c * points[:, 1] + poses[:, 1:2]
    return np.stack([x, y], axis=-1)


def distinct(poses: FloatArray, score: FloatArray, count: int) -> list[int]:
    """Indices of up to `count` poses, the highest score first, leaving out those that equal a better one."""
    away = np.hypot(poses[:, None, 0] - poses[None, :, 0], poses[:, None, 1] - poses[None, :, 1])
    turned = np.abs(
        np.remainder(poses[:, None, 2] - poses[None, :, 2] + np.pi, 2.0 * np.pi) - np.pi
    )
    same = (away < _SAME_M) & (turned < _SAME_RAD)
    free = np.ones(len(poses), dtype=bool)
    kept: list[int] = []
    for index in np.lexsort((np.arange(len(poses)), -score)):
        if free[index]:
            kept.append(int(index))
            free &= ~same[index]
            if len(kept) == count:
                break
    return kept
