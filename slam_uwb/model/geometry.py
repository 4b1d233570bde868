"""Poses of the plane, angles and array aliases.

Frames are in the names: ``target_T_source`` maps points given in *source* to *target*, and chains
read by cancelling neighbours: ``world_T_tag = world_T_station @ station_T_tag``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""Any array of floats; the aliases below say its shape."""
Points: TypeAlias = FloatArray
"""(N, 2) metres."""
Vector2: TypeAlias = FloatArray
"""(2,) metres."""
Matrix2: TypeAlias = FloatArray
"""(2, 2)."""
Matrix3: TypeAlias = FloatArray
"""(3, 3), order (x, y, theta)."""
Grid: TypeAlias = FloatArray
"""(H, W), row 0 at the smallest y."""


def wrap_angle(angle: float) -> float:
    """Bring an angle in radians into (-pi, pi]."""
    wrapped = math.remainder(angle, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


def rotation_matrix(theta: float) -> Matrix2:
    """(2, 2) counter-clockwise rotation by `theta` radians."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def frozen_array(
    value: ArrayLike, shape: Sequence[int | None], name: str, dtype: type[np.generic] = np.float64
) -> NDArray[np.generic]:
    """A read-only copy of `value` with the shape wanted (None: any length), or a ValueError that names it."""
    array = np.array(value, dtype=dtype)
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} has shape {array.shape}, expected {tuple(shape)}")
    array.setflags(write=False)
    return array


def freeze_arrays(
    holder: object, dtype: type[np.generic] = np.float64, /, **shapes: Sequence[int | None]
) -> None:
    """Put `frozen_array` copies in place of a frozen dataclass's arrays, by name."""
    for name, shape in shapes.items():
        object.__setattr__(holder, name, frozen_array(getattr(holder, name), shape, name, dtype))


@dataclass(frozen=True, slots=True)
class Pose2:
    """A rigid motion of the plane, SE(2): rotate by `theta`, then translate by (`x`, `y`)."""

    x: float
    """Metres."""
    y: float
    """Metres."""
    theta: float
    """Radians; kept in (-pi, pi]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", wrap_angle(self.theta))

    @classmethod
    def identity(cls) -> Pose2:
        """The motion that leaves everything where it is."""
        return cls(0.0, 0.0, 0.0)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> Pose2:
        """From (x, y, theta)."""
        x, y, theta = (float(v) for v in np.asarray(vector, dtype=np.float64))
        return cls(x, y, theta)

    def __matmul__(self, other: Pose2) -> Pose2:
        """Compose: ``a_T_c = a_T_b @ b_T_c``."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            self.theta + other.theta,
        )

    def inverse(self) -> Pose2:
        """``b_T_a`` of ``a_T_b``."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)

    def transform(self, points: ArrayLike) -> Points:
        """Map points (N, 2) or (2,) of the source frame to the target frame."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation

    def adjoint(self) -> Matrix3:
        """(3, 3) adjoint: ``T Exp(xi) = Exp(Ad_T xi) T`` with xi = (x, y, theta).

        A covariance given in the source's axes becomes one in the target's by ``Ad C Ad^T``.
        """
        c, s = math.cos(self.theta), math.sin(self.theta)
        return np.array([[c, -s, self.y], [s, c, -self.x], [0.0, 0.0, 1.0]])

    def distance_to(self, other: Pose2) -> float:
        """Metres between the two origins."""
        return math.hypot(self.x - other.x, self.y - other.y)

    def angle_to(self, other: Pose2) -> float:
        """Unsigned radians between the two headings."""
        return abs(wrap_angle(self.theta - other.theta))

    @property
    def rotation(self) -> Matrix2:
        """(2, 2) rotation part."""
        return rotation_matrix(self.theta)

    @property
    def translation(self) -> Vector2:
        """(2,) metres."""
        return np.array([self.x, self.y])

    @property
    def vector(self) -> FloatArray:
        """(3,) x, y, theta."""
        return np.array([self.x, self.y, self.theta])
