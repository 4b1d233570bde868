"""Refiners: from initial matches to matches, one signature.

``(target, source, initial target_T_source (K, 3), settings) -> Refinement``

`open3d` and `kiss_icp` need the extras of those names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...model.geometry import FloatArray
from ...model.settings import MatchingSettings
from ..index import ScanIndex
from ..lanes import ScanPair
from .kiss_icp import refine_kiss_icp
from .open3d import refine_open3d
from .paper_lm import refine_paper_lm
from .point_to_line import refine_pairs_to_lines, refine_point_to_line
from .refinement import Refinement

Refiner = Callable[[ScanIndex, ScanIndex, FloatArray, MatchingSettings], Refinement]

REFINERS: dict[str, Refiner] = {
    "kiss_icp": refine_kiss_icp,
    "open3d": refine_open3d,
    "paper_lm": refine_paper_lm,
    "point_to_line": refine_point_to_line,
}


def refine_pairs(
    pairs: Sequence[ScanPair], initial: Sequence[FloatArray], settings: MatchingSettings
) -> list[Refinement]:
    """What the refiner that is set makes of Q pairs, from poses target_T_source (K, 3) of each.

    One by one, but for the default: its work on one pair is too little for numpy to do it well.
    """
    if settings.refiner == "point_to_line":
        return refine_pairs_to_lines(pairs, initial, settings)
    refine = REFINERS[settings.refiner]
    return [
        refine(target, source, starts, settings)
        for (target, source), starts in zip(pairs, initial, strict=True)
    ]


__all__ = ["REFINERS", "Refinement", "Refiner", "refine_pairs"]
