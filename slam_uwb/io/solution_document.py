"""solution.json: pydantic models that mirror `Solution`, and the JSON Schema made from them.

Metres and radians as inside the program, so that poses and covariances share their units and every
number returns bit by bit; `null` is what is not known (NaN inside).
"""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..model.solution import Status

Real = Annotated[float | None, Field(allow_inf_nan=False)]
"""null: not known."""
Row2 = tuple[Real, Real]
Row3 = tuple[Real, Real, Real]


class _Document(BaseModel):
    # Keys that a later version adds must not keep this one from reading the rest.
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class PoseDocument(_Document):
    """A rigid motion of the plane."""

    x_m: float
    y_m: float
    theta_rad: Real = Field(description="counter-clockwise, (-pi, pi]; null: not known")


class AlternativeDocument(_Document):
    """Another place that the data do not exclude."""

    x_m: float
    y_m: float
    theta_rad: Real = Field(description="null for an anchor")
    weight: Real = Field(description="share of belief, 0-1")


class StationDocument(_Document):
    """Where a tripod stood."""

    id: str
    world_T_station: PoseDocument | None = Field(description="null where it could not be found")
    covariance: tuple[Row3, Row3, Row3] | None = Field(
        description="order x (m), y (m), theta (rad), in the station's own axes"
    )
    status: Status
    heading_known: bool
    alternatives: list[AlternativeDocument]


class AnchorDocument(_Document):
    """Where an anchor is."""

    id: str
    position_m: tuple[float, float] | None = Field(description="x, y in the world frame")
    covariance_m2: tuple[Row2, Row2] | None = Field(description="in the world's axes")
    height_m: Real
    stations: int = Field(description="how many stations' links were used")
    status: Status
    alternatives: list[AlternativeDocument]


class MatchDocument(_Document):
    """One hypothesis of how two scans lie to each other."""

    target: str = Field(description="station_m of matches.csv")
    source: str = Field(description="station_n of matches.csv")
    target_T_source: PoseDocument
    covariance: tuple[Row3, Row3, Row3] = Field(
        description="order x (m), y (m), theta (rad), in the source's axes"
    )
    overlap: Real
    violation: Real
    score: Real
    rank: int
    degenerate: bool
    rejection: str | None = Field(description="why it is not used; null where it is")


class LinkDocument(_Document):
    """All ranges of one station and one anchor."""

    station: str
    anchor: str
    distance_m: Real
    mean_m: Real
    sigma_m: Real
    samples: int
    discarded: int
    residual_m: Real = Field(description="measured minus predicted")
    walls: Real
    nlos_probability: Real
    rejection: str | None = Field(description="why it is not used; null where it is")


class BiasDocument(_Document):
    """An estimated constant of the ranges with its prior."""

    name: str
    mean_m: Real
    sigma_m: Real
    prior_mean_m: Real
    prior_sigma_m: Real


class ChecksDocument(_Document):
    """How far the solver's answer was confirmed by another way to it."""

    isam2_batch_gap_m: Real
    other_starts_gap_m: Real
    iterations: int
    cost: Real


class JointDocument(_Document):
    """Joint covariance of all that was solved."""

    names: list[str] = Field(description="stations (3 rows each), then anchors (2 rows each)")
    covariance: list[list[Real]] | None = Field(
        description="square; m and rad, stations in their own axes"
    )


class MapDocument(_Document):
    """Occupancy grid in the world frame."""

    height: int = Field(ge=0, description="rows; row 0 at the smallest y")
    width: int = Field(ge=0)
    resolution_m: float = Field(gt=0.0)
    origin_m: tuple[float, float] = Field(description="lower left corner of cell (0, 0)")
    cells: str = Field(
        description="height * width bytes, row by row, zlib, base64; 255 was never seen, else "
        "254 times the probability that the cell is occupied"
    )


class ScanDocument(_Document):
    """A station's scan, one sample an angle bin."""

    station: str
    bearings_rad: list[float] = Field(description="counter-clockwise, in the scanner's frame")
    ranges_m: list[Real] = Field(description="null: no return")
    max_range_m: float


class RoomDocument(_Document):
    """A closed room."""

    polygon_m: list[tuple[float, float]] = Field(
        description="counter-clockwise, between wall faces"
    )
    area_m2: float


class WallDocument(_Document):
    """A wall, or one face of it."""

    ends_m: tuple[tuple[float, float], tuple[float, float]]
    thickness_m: Real = Field(description="null where only one face was seen: ends are the face's")
    probability: Real


class PlanDocument(_Document):
    """Rooms, walls and doors in the world frame."""

    rooms: list[RoomDocument] = Field(description="the largest first")
    walls: list[WallDocument]
    doors_m: list[tuple[tuple[float, float], tuple[float, float]]] = Field(
        description="each from jamb to jamb"
    )


class DecisionDocument(_Document):
    """What became of something that a person decided."""

    kind: Literal["pair", "link"]
    a: str
    b: str
    decision: Literal["keep", "drop", "guess"]
    guess: PoseDocument | None = Field(description="b in a's frame")
    effect: str = Field(description="what was done")
    contradiction: str | None = Field(description="what in the data speaks against it")


class MoveDocument(_Document):
    """How one station or anchor changed since the earlier solution."""

    kind: Literal["station", "anchor"]
    id: str
    distance_m: Real = Field(description="null where one of the two solutions has no place")
    sigma_before_m: Real = Field(description="along the longest axis")
    sigma_after_m: Real
    status_before: Status
    status_after: Status


class ContinuationDocument(_Document):
    """The earlier solution that this one continues."""

    checksum: str = Field(description="of the earlier survey")
    added: list[str] = Field(description="stations that are new")
    seen_from: str | None = Field(
        description="station from which moves are seen; null: both frames are the same"
    )
    moves: list[MoveDocument]


class SolutionDocument(_Document):
    """Everything that was found about one survey."""

    format: Literal[1]
    survey: str = Field(description="name of the survey")
    checksum: str = Field(description="SHA-256 over the survey's files, hexadecimal")
    software_version: str
    mode: str
    frame: str = Field(description="`site`, or the station whose frame the world is")
    tag_offset_m: tuple[float, float] = Field(description="antenna in the scanner's frame")
    stations: list[StationDocument]
    anchors: list[AnchorDocument]
    links: list[LinkDocument]
    matches: list[MatchDocument]
    biases: list[BiasDocument]
    joint: JointDocument
    checks: ChecksDocument | None
    warnings: list[str]
    # Not there in solutions of the first version.
    decisions: list[DecisionDocument] = []
    plan: PlanDocument | None = None
    picture: MapDocument | None = Field(
        default=None,
        description="that the frame was aligned to; cells tell how dark it is, none is unknown",
    )
    continued: ContinuationDocument | None = Field(
        default=None, description="null: solved from scratch"
    )
    alignment: PoseDocument | None = Field(
        default=None, description="from the frame of the station to that of all places here"
    )
    tag_heights_m: dict[str, float] = Field(default={}, description="above the floor, by station")
    settings: dict[str, Any] = Field(description="all of them, as settings.toml has them")
    floor_map: MapDocument | None
    scans: list[ScanDocument]


def real(value: float | None) -> float | None:
    """A number for the document: null where it is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


def solution_schema() -> str:
    """JSON Schema (draft 2020-12) of solution.json, as ``solution.schema.json`` has it."""
    schema = SolutionDocument.model_json_schema(mode="serialization")
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema
    return json.dumps(schema, indent=2) + "\n"
