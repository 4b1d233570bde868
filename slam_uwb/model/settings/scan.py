"""One recording and how it is reduced."""

from __future__ import annotations

from pydantic import Field

from .section import Section


class ScanSettings(Section):
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
