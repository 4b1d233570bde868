"""One independent stream of random numbers a thing: what comes later never changes what came before."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What the numbers are for; the values must never change, or no survey would come out the same."""

    SCENE = 0
    STATION = 1
    ANCHOR = 2
    TAG = 3
    LINK = 4
    SAMPLES = 5
    STAYS = 6
    STAY_RECEPTION = 7
    WALK_RECEPTION = 8


def stream(seed: int, *key: int) -> np.random.Generator:
    """The generator of one thing of one seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=[int(k) for k in key]))
