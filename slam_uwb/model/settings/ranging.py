"""How samples become one measurement a link."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .section import Section


class RangingSettings(Section):
    """Range samples -> one measurement a link."""

    max_range_m: float = Field(
        1000.0, gt=0.0, description="longer samples are absurd: kept, counted, not used"
    )
    sample_sigma_m: float = Field(
        0.025, gt=0.0, description="jitter of one sample within a link (real EVK1000 links)"
    )
    link_sigma_m: float = Field(
        0.10,
        gt=0.0,
        description="standard deviation of the constant error of a link in line of sight",
    )
    path_gap_m: float = Field(
        0.2,
        gt=0.0,
        description="samples of a link further apart than this came by different paths (8 sigmas of jitter)",
    )
    path_share: float = Field(
        0.2,
        gt=0.0,
        le=0.5,
        description="a path with a smaller share of a link's samples is a fault of the device",
    )
    max_reflection_m: float = Field(
        3.0,
        gt=0.0,
        description="a path longer by up to this may be a reflection of the shorter one, which is then "
        "believed; beyond, the one with more samples",
    )
    two_way: Literal["asymmetric", "symmetric"] = Field(
        "asymmetric",
        description="periods -> distance; `symmetric` is the paper's eq. 2, biased where the two replies "
        "differ",
    )
