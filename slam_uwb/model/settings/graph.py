"""How poses and anchors are estimated, and when an anchor is not to be trusted."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .section import Section


class GraphSettings(Section):
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
    fault_cost_gap: float = Field(
        7.0,
        ge=0.0,
        description="the same for a place at which one range is a fault that the best one explains: even "
        "odds of a fault, as how often devices fail is not known beforehand",
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
        0.5,
        gt=0.0,
        description="a place found by ranges with a larger standard deviation is weak-geometry",
    )
    weak_pose_sigma_m: float = Field(
        0.125,
        gt=0.0,
        description="a station placed by its scan with a larger one is: its walls blur the map",
    )
    anchor_inflation: float = Field(
        1.3,
        ge=1.0,
        description="factor on the covariances of anchors: wrong labels and tails (joint study, 7)",
    )
    pose_inflation: float = Field(
        1.6,
        ge=1.0,
        description="factor on the covariances of stations placed by scans: the graph takes matches of one "
        "scan for independent, though its noise is in all of them",
    )
    max_passes: int = Field(100, ge=1, description="outer passes of re-weighting")
    tolerance_m: float = Field(1e-7, gt=0.0, description="passes end when nothing moves further")
