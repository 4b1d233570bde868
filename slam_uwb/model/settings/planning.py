"""How places to measure next are chosen."""

from __future__ import annotations

from pydantic import Field

from .section import Section


class PlanningSettings(Section):
    """Solution -> where to measure next."""

    spacing_m: float = Field(0.4, gt=0.0, description="grid of the places that are looked at")
    clearance_m: float = Field(
        0.4, ge=0.0, description="from walls, furniture and the unknown: a tripod's legs"
    )
    reach_m: float = Field(10.0, gt=0.0, description="walls further away do not hold a scan")
    min_known_view: float = Field(
        0.3,
        ge=0.0,
        le=1.0,
        description="share of the view that must end at walls of the map for a place to be suggested",
    )
    sure_known_view: float = Field(
        0.6,
        gt=0.0,
        le=1.0,
        description="share from which on the scan surely matches; below, in proportion",
    )
    sight_sigma_m: float = Field(
        0.12,
        gt=0.0,
        description="expected error of a range in line of sight, its anchor's own included",
    )
    wall_sigma_m: float = Field(
        0.35,
        gt=0.0,
        description="what each wall on the way adds to it (root of the sum of squares)",
    )
    shared_radius_m: float = Field(
        2.0,
        gt=0.0,
        description="distance over which the correlation of two stations' range errors falls to 1/e: "
        "half a room, past the same wall and cupboard",
    )
    useless_m: float = Field(
        0.5,
        gt=0.0,
        description="expected error of an anchor that is of little use; how much more it is hardly counts",
    )
