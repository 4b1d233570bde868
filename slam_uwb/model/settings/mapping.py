"""How scans and poses become a map: cells, walls and rooms."""

from __future__ import annotations

from pydantic import Field

from .section import Section


class MappingSettings(Section):
    """Scans and poses -> floor map."""

    resolution_m: float = Field(0.05, gt=0.0, description="edge of a cell")
    margin_m: float = Field(0.5, ge=0.0, description="unknown border round everything seen")
    hit_log_odds: float = Field(
        3.0,
        gt=0.0,
        description="what one scan that sees a wall adds to a cell; it outweighs one that passed: poses "
        "err",
    )
    free_log_odds: float = Field(
        -1.5,
        lt=0.0,
        description="what one scan that looks through adds; one tripod recording makes a cell free",
    )
    max_log_odds: float = Field(
        5.0, gt=0.0, description="more evidence does not make a cell more certain"
    )
    max_cells: int = Field(
        20_000_000,
        ge=1,
        description="a larger map gets resolution_m doubled until it fits (memory: 32 bytes a cell)",
    )
    wall_angle_deg: float = Field(
        7.0, gt=0.0, lt=45.0, description="segments of one wall line differ by less in direction"
    )
    wall_distance_m: float = Field(
        0.12,
        gt=0.0,
        description="segments and points of a wall line are closer to it: noise of scans and poses",
    )
    wall_cell_m: float = Field(0.1, gt=0.0, description="cell along a wall line")
    wall_neighbour_gap_m: float = Field(
        0.3, gt=0.0, description="hits of neighbouring bins closer than this have wall between them"
    )
    wall_beyond_m: float = Field(
        0.25, gt=0.0, description="a beam that ends so far behind a line looked through it"
    )
    wall_incidence: float = Field(
        0.2,
        ge=0.0,
        le=1.0,
        description="beams flatter to the line (sine) do not count as looking through: poses err",
    )
    wall_fill_gap_m: float = Field(
        2.5,
        ge=0.0,
        description="a shorter gap that nobody looked through hides behind furniture, and is wall",
    )
    wall_fill_free_share: float = Field(
        0.2, ge=0.0, le=1.0, description="more of a gap looked through makes it an opening"
    )
    wall_chain_gap_m: float = Field(
        1.6,
        gt=0.0,
        description="a wall goes on behind a door (up to 1.5 m); pieces of furniture are further apart",
    )
    wall_chain_m: float = Field(
        2.1,
        gt=0.0,
        description="length seen in one chain that is as likely wall as furniture, which is mostly < 2 m",
    )
    wall_chain_slope_m: float = Field(
        0.35, gt=0.0, description="how fast that likelihood changes with length (logistic)"
    )
    room_wall_probability: float = Field(
        0.5, ge=0.0, le=1.0, description="what is less likely a wall bounds no room"
    )
    room_min_area_m2: float = Field(
        1.0, gt=0.0, description="smaller closed spaces are shafts and gaps behind furniture"
    )
