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
        0.25,
        gt=0.0,
        description="what each wall on the way adds to it (root of the sum of squares); less than the "
        "scatter of a wall's delay, 0.35 m, since a delay is never negative: what counts is the "
        "Fisher information",
    )
    shared_radius_m: float = Field(
        1.0,
        gt=0.0,
        description="distance over which the correlation of two stations' range errors falls to 1/e",
    )
    useless_m: float = Field(
        1.0,
        gt=0.0,
        description="expected error from which on an anchor is of no use, however wrong it is",
    )
