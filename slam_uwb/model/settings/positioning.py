"""How a tag is located with known anchors."""

from __future__ import annotations

from pydantic import Field

from .section import Section


class PositioningSettings(Section):
    """Known anchors and what they heard of a tag -> where the tag is (paper, section IV)."""

    arrival_sigma_m: float = Field(
        0.3,
        gt=0.0,
        description="standard deviation of one anchor's time of arrival: mostly the constant errors of links, "
        "a decimetre in line of sight and a few behind walls",
    )
    acceleration_mps2: float = Field(
        0.7, gt=0.0, description="standard deviation of a person's acceleration, each axis"
    )
    start_speed_mps: float = Field(
        1.0, gt=0.0, description="standard deviation of the velocity at the start, each axis"
    )
    outlier_sigmas: float = Field(
        2.0,
        gt=0.0,
        description="a measurement further from its prediction counts less, in proportion (Huber)",
    )
    search_step_m: float = Field(
        0.5, gt=0.0, description="grid on which the start is sought, round the anchors"
    )
    search_margin_m: float = Field(
        3.0, ge=0.0, description="how far the tag may be outside the anchors at the start"
    )
    settling_s: float = Field(
        3.0, ge=0.0, description="of a static tag's track, left out of its mean place"
    )
