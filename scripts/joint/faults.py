"""Ranges spoiled on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.survey import AnchorId, StationId

JUMPS_M = (1.5, 30.0)
CLEAN = 3
"""Links of an anchor that are left as they are, at least."""
SHORTEST_M = 0.3


def spoil_links(
    links: Sequence[LinkMeasurement], part: float, rng: np.random.Generator
) -> tuple[list[LinkMeasurement], set[tuple[StationId, AnchorId]]]:
    """The links with that part (0-1) of every anchor's jumped, to either side; and which these are."""
    spoiled = list(links)
    for anchor in sorted({link.anchor for link in links}):
        rows = [k for k, link in enumerate(links) if link.anchor == anchor]
        count = max(0, min(round(part * len(rows)), len(rows) - CLEAN))
        for k in rng.permutation(rows)[:count]:
            jump = rng.uniform(*JUMPS_M) * rng.choice((-1.0, 1.0))
            # No range is negative: what would be jumps the other way.
            if links[k].distance + jump < SHORTEST_M:
                jump = -jump
            changed = {"distance": links[k].distance + jump, "mean": links[k].mean + jump}
            spoiled[k] = replace(links[k], **changed)
    names = {
        (new.station, new.anchor) for new, old in zip(spoiled, links, strict=True) if new is not old
    }
    return spoiled, names
