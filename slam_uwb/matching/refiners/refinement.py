"""What a refiner hands back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...model.geometry import FloatArray, freeze_arrays


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """What became of the initial matches of one pair: J of them, those that ended in one place once.

    Covariance, overlap and violation are not here: a refiner's own word for them is not taken, and
    most of the J are about to be dropped. `describe_match` computes them, in one way for all
    refiners, for the few that are kept.
    """

    poses: FloatArray
    """(J, 3) target_T_source; the start's where nothing came of it."""
    converged: NDArray[np.bool_]
    """(J,) whether the pose is an answer. A start given back for want of anything near it is none."""
    iterations: NDArray[np.int64] | None
    """(J,) steps taken; None where the library does not tell."""

    def __post_init__(self) -> None:
        count = len(self.poses)
        freeze_arrays(self, poses=(None, 3))
        freeze_arrays(self, np.bool_, converged=(count,))
        if self.iterations is not None:
            freeze_arrays(self, np.int64, iterations=(count,))
