"""Every knob of the method on one page: default, unit (in the name), limits and the reason.

Settings are frozen, refuse unknown keys at every level and are tuned by file only (``--settings
FILE``). `PRESETS` holds named sets; ``paper`` is what Kolakowski et al. 2020 print.
"""

from __future__ import annotations

import json
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from .errors import SettingsError


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ScanSettings(_Section):
    """One recording -> one point an angle bin, normals, wall segments, landmarks."""

    bin_deg: float = Field(
        1.0,
        gt=0.0,
        le=10.0,
        description="angle bin whose samples are reduced to one point near their median",
    )
    min_return_share: float = Field(
        0.5, ge=0.0, le=1.0, description="a bin with fewer returns among its samples is no return"
    )
    neighbour_gap_m: float = Field(
        0.3,
        gt=0.0,
        description="points of neighbouring bins further apart do not belong to one wall",
    )
    split_distance_m: float = Field(
        0.06,
        gt=0.0,
        description="a point further from the chord splits a wall (above the scanner's noise)",
    )
    min_segment_length_m: float = Field(
        0.3, gt=0.0, description="shorter segments are clutter (paper, III.A)"
    )
    min_segment_points: int = Field(4, ge=2, description="fewer points do not make a wall")
    min_intersection_deg: float = Field(
        20.0,
        gt=0.0,
        le=90.0,
        description="flatter intersections of wall lines are too uncertain for landmarks",
    )
    max_landmark_range_m: float = Field(
        25.0, gt=0.0, description="virtual intersections further off are dropped"
    )
    cluster_distance_m: float = Field(
        0.3, gt=0.0, description="landmarks closer than this are one (Algorithm 2)"
    )
    normal_radius_m: float = Field(
        0.3, gt=0.0, description="neighbours that define the normal of a point"
    )
    max_point_length_m: float = Field(
        0.25,
        gt=0.0,
        description="a point stands for at most this much wall, however sparse the scan is there",
    )


class MatchingSettings(_Section):
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


class RangingSettings(_Section):
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


class GraphSettings(_Section):
    """Matches and links -> poses and anchors."""

    mode: Literal["joint", "sequential"] = Field(
        "joint", description="`sequential` is the paper's method"
    )
    radios: Literal["uncalibrated", "calibrated"] = Field(
        "uncalibrated",
        description="what is known of antenna delays where the survey states no offset: nothing, or that "
        "they have been taken out",
    )
    calibrated_sigma_m: float = Field(
        0.03, gt=0.0, description="standard deviation of what a calibration leaves of the offset"
    )
    offset_mean_m: float = Field(
        0.18,
        description="prior of the offset common to all ranges where the survey states none: uncalibrated "
        "radios",
    )
    offset_sigma_m: float = Field(0.10, gt=0.0, description="its standard deviation")
    no_offset_gain: float = Field(
        1.0,
        ge=0.0,
        description="offsets of radios in line of sight are dropped where the evidence without them is "
        "better by more (nats; joint study, 5)",
    )
    min_stations: int = Field(
        3, ge=3, description="an anchor enters when this many stations not in line see it"
    )
    min_singular_ratio: float = Field(
        0.10,
        ge=0.0,
        le=1.0,
        description="stations whose spread across their line is smaller are in line",
    )
    mirror_cost_gap: float = Field(
        3.0,
        ge=0.0,
        description="a second place within this much cost (negative log likelihood) is not excluded",
    )
    moved_cost_gap: float = Field(
        12.0,
        ge=0.0,
        description="an anchor was moved where two places in turn explain its ranges better by more "
        "(nats; of 260 simulated anchors that stand still one reaches 10, moved ones 11 to 50)",
    )
    search_step_m: float = Field(
        0.3,
        gt=0.0,
        description="grid on which the places of anchors are sought; finds all minima (joint study)",
    )
    twin_distance_m: float = Field(0.5, gt=0.0, description="minima closer than this are one place")
    shared_error_radius_m: float = Field(
        0.5,
        ge=0.0,
        description="stations closer than this share the errors of their links and count as one",
    )
    weak_sigma_m: float = Field(
        0.5, gt=0.0, description="an anchor with a larger standard deviation is weak-geometry"
    )
    anchor_inflation: float = Field(
        1.3,
        ge=1.0,
        description="factor on the covariances of anchors: wrong labels and tails (joint study, 7)",
    )
    max_passes: int = Field(100, ge=1, description="outer passes of re-weighting")
    tolerance_m: float = Field(1e-7, gt=0.0, description="passes end when nothing moves further")


class MappingSettings(_Section):
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


class PositioningSettings(_Section):
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


class PlanningSettings(_Section):
    """Solution -> where to measure next."""

    spacing_m: float = Field(0.4, gt=0.0, description="grid of the places that are looked at")
    clearance_m: float = Field(
        0.4, ge=0.0, description="from walls, furniture and the unknown: a tripod's legs"
    )
    reach_m: float = Field(10.0, gt=0.0, description="walls further away do not hold a scan")
    min_known_view: float = Field(
        0.6,
        ge=0.0,
        le=1.0,
        description="share of the view that must end at walls of the map, so that the scan matches",
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
        1.0,
        ge=0.0,
        description="ranges of stations closer than this have much of their error in common",
    )


class Settings(_Section):
    """All sections."""

    scan: ScanSettings = ScanSettings()
    matching: MatchingSettings = MatchingSettings()
    ranging: RangingSettings = RangingSettings()
    graph: GraphSettings = GraphSettings()
    mapping: MappingSettings = MappingSettings()
    planning: PlanningSettings = PlanningSettings()
    positioning: PositioningSettings = PositioningSettings()


PRESETS: dict[str, Settings] = {
    "default": Settings(),
    "paper": Settings(
        matching=MatchingSettings(
            initialiser="landmark",
            refiner="paper_lm",
            ranking="closest_points",
            placement="sequence",
            initial_matches=5,
            hypotheses=5,
        ),
        ranging=RangingSettings(two_way="symmetric"),
    ),
}


_UNKNOWN = {"extra_forbidden": "no such setting; `slam-uwb settings` prints all of them"}
"""pydantic says this in its own terms."""


def settings_from_mapping(mapping: dict[str, Any]) -> Settings:
    """Settings from a nested mapping of what differs from the defaults.

    Raises:
        SettingsError: names every bad key, its value and the limit.
    """
    try:
        # Strict, or "0.1" and true would pass for numbers; by way of JSON, whose lists may be tuples.
        return Settings.model_validate_json(json.dumps(mapping, default=str), strict=True)
    except ValidationError as error:
        problems = [
            (
                ".".join(map(str, e["loc"])),
                f"{_UNKNOWN.get(e['type'], e['msg'])} (given: {e['input']!r})",
            )
            for e in error.errors()
        ]
        first_key, first = problems[0]
        rest = "".join(f"\nsettings: {key}: {problem}" for key, problem in problems[1:])
        raise SettingsError(first_key, first + rest) from None
