"""The text of solution.json -> `Solution`."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from pydantic import ValidationError

from ..model.errors import Fault, SettingsError, SurveyFormatError
from ..model.floor import FloorMap, FloorPlan, Room, Wall
from ..model.geometry import FloatArray, Pose2
from ..model.products import LinkMeasurement, ScanMatch
from ..model.settings import settings_from_mapping
from ..model.solution import (
    Alternative,
    AnchorEstimate,
    Bias,
    Continuation,
    DecisionOutcome,
    Move,
    Solution,
    SolverChecks,
    StationEstimate,
)
from ..model.survey import AnchorId, Decision, Scan, StationId
from . import solution_document as doc
from .findings import shown
from .floor_map_files import occupancy_of, unpack

SOLUTION_JSON = "solution.json"


def parse_solution_json(data: bytes, name: str = SOLUTION_JSON) -> Solution:
    """The solution of a text; SurveyFormatError says in one line what is wrong with a damaged one."""
    try:
        return _solution(doc.SolutionDocument.model_validate_json(data, strict=True))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in first["loc"])[1:]
        given = (
            "" if first["type"] in ("missing", "json_invalid") else f" = {shown(first['input'])}"
        )
        problem = f"{where}{given}{': ' if where else ''}{first['msg']}"
    except SettingsError as error:
        problem = str(error).partition("\n")[0]
    except ValueError as error:
        problem = str(error)
    raise SurveyFormatError([Fault(name, problem)])


def _solution(document: doc.SolutionDocument) -> Solution:
    return Solution(
        survey_name=document.survey,
        checksum=document.checksum,
        mode=document.mode,
        settings=settings_from_mapping(document.settings),
        software_version=document.software_version,
        frame=document.frame,
        stations=tuple(map(_station, document.stations)),
        anchors=tuple(map(_anchor, document.anchors)),
        matches=tuple(map(_match, document.matches)),
        links=tuple(map(_link, document.links)),
        biases=tuple(map(_bias, document.biases)),
        joint_names=tuple(document.joint.names),
        joint_covariance=_joint(document),
        checks=None if document.checks is None else _checks(document.checks),
        floor_map=None if document.floor_map is None else _map(document.floor_map),
        scans={StationId(item.station): _scan(item) for item in document.scans},
        tag_offset=document.tag_offset_m,
        warnings=tuple(document.warnings),
        decisions=tuple(map(_decision, document.decisions)),
        tag_heights={StationId(name): value for name, value in document.tag_heights_m.items()},
        alignment=None if document.alignment is None else _pose(document.alignment),
        plan=None if document.plan is None else _plan(document.plan),
        picture=None if document.picture is None else _map(document.picture),
        continued=None if document.continued is None else _continued(document.continued),
    )


def _plan(item: doc.PlanDocument) -> FloorPlan:
    return FloorPlan(
        rooms=tuple(
            Room(np.array(room.polygon_m).reshape(-1, 2), room.area_m2) for room in item.rooms
        ),
        walls=tuple(
            Wall(np.array(wall.ends_m), _float(wall.thickness_m), _float(wall.probability))
            for wall in item.walls
        ),
        doors=np.array(item.doors_m).reshape(-1, 2, 2),
    )


def _decision(item: doc.DecisionDocument) -> DecisionOutcome:
    guess = None if item.guess is None else _pose(item.guess)
    decision = Decision(item.kind, item.a, item.b, item.decision, guess)
    return DecisionOutcome(decision, item.effect, item.contradiction)


def _continued(item: doc.ContinuationDocument) -> Continuation:
    return Continuation(
        checksum=item.checksum,
        added=tuple(map(StationId, item.added)),
        seen_from=item.seen_from,
        moves=tuple(
            Move(
                move.kind,
                move.id,
                _float(move.distance_m),
                _float(move.sigma_before_m),
                _float(move.sigma_after_m),
                move.status_before,
                move.status_after,
            )
            for move in item.moves
        ),
    )


def _float(value: float | None) -> float:
    return math.nan if value is None else value


def _matrix(rows: Iterable[Iterable[float | None]]) -> FloatArray:
    return np.array([[_float(value) for value in row] for row in rows], dtype=np.float64)


def _pose(pose: doc.PoseDocument) -> Pose2:
    return Pose2(pose.x_m, pose.y_m, _float(pose.theta_rad))


def _alternatives(items: Iterable[doc.AlternativeDocument]) -> tuple[Alternative, ...]:
    return tuple(Alternative(i.x_m, i.y_m, i.theta_rad, _float(i.weight)) for i in items)


def _joint(document: doc.SolutionDocument) -> FloatArray | None:
    rows = document.joint.covariance
    if rows is None:
        return None
    if any(len(row) != len(rows) for row in rows):
        raise ValueError(f"joint.covariance: expected {len(rows)} numbers in each of its rows")
    return _matrix(rows).reshape(len(rows), len(rows))


def _station(item: doc.StationDocument) -> StationEstimate:
    return StationEstimate(
        id=StationId(item.id),
        pose=None if item.world_T_station is None else _pose(item.world_T_station),
        covariance=None if item.covariance is None else _matrix(item.covariance),
        status=item.status,
        heading_known=item.heading_known,
        alternatives=_alternatives(item.alternatives),
    )


def _anchor(item: doc.AnchorDocument) -> AnchorEstimate:
    return AnchorEstimate(
        id=AnchorId(item.id),
        position=None if item.position_m is None else np.array(item.position_m),
        covariance=None if item.covariance_m2 is None else _matrix(item.covariance_m2),
        height=item.height_m,
        stations=item.stations,
        status=item.status,
        alternatives=_alternatives(item.alternatives),
    )


def _match(item: doc.MatchDocument) -> ScanMatch:
    return ScanMatch(
        target=StationId(item.target),
        source=StationId(item.source),
        target_T_source=_pose(item.target_T_source),
        covariance=_matrix(item.covariance),
        overlap=_float(item.overlap),
        violation=_float(item.violation),
        score=_float(item.score),
        rank=item.rank,
        degenerate=item.degenerate,
        rejection=item.rejection,
    )


def _link(item: doc.LinkDocument) -> LinkMeasurement:
    return LinkMeasurement(
        station=StationId(item.station),
        anchor=AnchorId(item.anchor),
        distance=_float(item.distance_m),
        mean=_float(item.mean_m),
        sigma=_float(item.sigma_m),
        samples=item.samples,
        discarded=item.discarded,
        residual=_float(item.residual_m),
        walls=_float(item.walls),
        nlos_probability=_float(item.nlos_probability),
        rejection=item.rejection,
    )


def _bias(item: doc.BiasDocument) -> Bias:
    return Bias(
        name=item.name,
        mean=_float(item.mean_m),
        sigma=_float(item.sigma_m),
        prior_mean=_float(item.prior_mean_m),
        prior_sigma=_float(item.prior_sigma_m),
    )


def _checks(item: doc.ChecksDocument) -> SolverChecks:
    return SolverChecks(
        isam2_batch_gap=_float(item.isam2_batch_gap_m),
        other_starts_gap=_float(item.other_starts_gap_m),
        iterations=item.iterations,
        cost=_float(item.cost),
    )


def _map(item: doc.MapDocument) -> FloorMap:
    try:
        cells = unpack(item.cells, item.height, item.width)
    except ValueError as error:
        raise ValueError(f"floor_map.cells: {error}") from None
    return FloorMap(occupancy_of(cells), item.resolution_m, item.origin_m)


def _scan(item: doc.ScanDocument) -> Scan:
    return Scan(
        bearings=np.array(item.bearings_rad, dtype=np.float64),
        ranges=np.array([_float(value) for value in item.ranges_m], dtype=np.float64),
        max_range=item.max_range_m,
    )
