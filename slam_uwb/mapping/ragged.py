"""Rows of different lengths in one flat array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def ragged(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For rows of `counts` elements: the row of each element and its place in the row."""
    row = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    return row, place
