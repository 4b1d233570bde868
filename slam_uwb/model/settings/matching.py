"""How scans are matched, and which matches are used."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .section import Section


class MatchingSettings(Section):
    """Two scans -> relative poses."""

    pairs: Literal["all", "sequence"] = Field("all", description="which pairs are tried")
    all_pairs_stations: int = Field(
        40,
        ge=0,
        description="in larger surveys with ranges only pairs that these do not put far apart are tried",
    )
    near_by_ranges_m: float = Field(
        8.0,
        gt=0.0,
        description="ranges of two stations to their anchors differ by less than this where they may see "
        "walls in common",
    )
    initialiser: Literal["correlative", "landmark"] = Field(
        "correlative",
        description="how initial matches are found; `landmark` is the paper's Algorithm 3",
    )
    refiner: Literal["point_to_line", "paper_lm", "open3d", "kiss_icp"] = Field(
        "point_to_line",
        description="how they are refined; `paper_lm` is the paper's Algorithm 4; `open3d` and "
        "`kiss_icp` are other people's, to compare with, and need the extras of those names",
    )
    ranking: Literal["evidence", "closest_points"] = Field(
        "evidence",
        description="what makes a match the best of a pair: walls confirmed and looked through, both "
        "ways, or the paper's number of points with a closest point nearer than "
        "closest_point_m",
    )
    placement: Literal["evidence", "sequence"] = Field(
        "evidence",
        description="which matches are used: those that agree with the merged map, or every best one (the "
        "paper)",
    )
    landmark_side_m: float = Field(
        0.1,
        gt=0.0,
        description="largest difference of corresponding triangle sides (paper, Algorithm 3)",
    )
    max_triples: int = Field(
        200_000,
        ge=1,
        description="corresponding triples looked at a pair; evenly thinned beyond (time and memory)",
    )
    closest_point_m: float = Field(
        0.4, gt=0.0, description="d_max of the paper's Algorithms 3 and 4"
    )
    initial_matches: int = Field(
        24, ge=1, description="initial matches handed to the refiner; the paper's is 5"
    )
    hypotheses: int = Field(8, ge=1, description="refined matches kept a pair")
    correlation_cell_m: float = Field(
        0.18,
        gt=0.0,
        description="grid of the correlation; coarser is faster and finds more (registration study)",
    )
    correlation_radius_m: float = Field(
        12.0, gt=0.0, description="walls further from the scanner are left out of it"
    )
    free_space_margin_m: float = Field(
        0.25,
        gt=0.0,
        description="free space ends this far before the nearest return of the neighbouring beams",
    )
    fine_gate_m: float = Field(
        0.2, gt=0.0, description="last stage of the refiner: points further apart do not pair"
    )
    violation_weight: float = Field(
        10.0,
        ge=0.0,
        description="how many metres of confirmed wall one metre looked through outweighs",
    )
    min_evidence_m: float = Field(
        1.0, description="hypotheses with less evidence (metres of wall of both scans) are not kept"
    )
    min_margin_m: float = Field(
        1.5,
        gt=0.0,
        description="stations are placed where the evidence (metres of wall, each once) exceeds that of "
        "every other place by this",
    )
    range_weight_m: float = Field(
        3.0,
        ge=0.0,
        description="metres of wall that one nat of evidence by the ranges counts for: neighbouring "
        "points of a wall say the same thing",
    )
    min_overlap: float = Field(
        0.10,
        ge=0.0,
        le=1.0,
        description="pairs that confirm less of each other enter the graph only where no other pair "
        "joins their stations",
    )
    sigma_floor_m: float = Field(
        0.0003,
        ge=0.0,
        description="standard deviation added to a match for what its residuals cannot show; what they "
        "show (tilt, glass, walls that miss each other) is in its covariance already",
    )
    sigma_floor_deg: float = Field(0.003, ge=0.0, description="the same for its heading")
