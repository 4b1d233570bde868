"""`Solution` -> the text of solution.json."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..model.floor import FloorMap, FloorPlan
from ..model.geometry import FloatArray, Pose2
from ..model.products import LinkMeasurement, ScanMatch
from ..model.solution import (
    Alternative,
    AnchorEstimate,
    Bias,
    Continuation,
    DecisionOutcome,
    Solution,
    SolverChecks,
    StationEstimate,
)
from ..model.survey import Scan
from . import solution_document as doc
from .floor_map_files import pack, quantise
from .solution_document import real


def solution_json(solution: Solution) -> bytes:
    """solution.json: compact, without any NaN, the same bytes for the same solution."""
    document = doc.SolutionDocument(
        format=1,
        survey=solution.survey_name,
        checksum=solution.checksum,
        software_version=solution.software_version,
        mode=solution.mode,
        frame=solution.frame,
        tag_offset_m=solution.tag_offset,
        stations=[_station(item) for item in solution.stations],
        anchors=[_anchor(item) for item in solution.anchors],
        links=[_link(item) for item in solution.links],
        matches=[_match(item) for item in solution.matches],
        biases=[_bias(item) for item in solution.biases],
        joint=doc.JointDocument(
            names=list(solution.joint_names), covariance=_rows(solution.joint_covariance)
        ),
        checks=None if solution.checks is None else _checks(solution.checks),
        warnings=list(solution.warnings),
        decisions=[_decision(item) for item in solution.decisions],
        tag_heights_m={str(name): height for name, height in solution.tag_heights.items()},
        alignment=None if solution.alignment is None else _pose(solution.alignment),
        picture=None if solution.picture is None else _map(solution.picture),
        continued=None if solution.continued is None else _continued(solution.continued),
        plan=None if solution.plan is None else _plan(solution.plan),
        settings=solution.settings.model_dump(mode="json"),
        floor_map=None if solution.floor_map is None else _map(solution.floor_map),
        scans=[_scan(name, scan) for name, scan in solution.scans.items()],
    )
    return document.model_dump_json().encode() + b"\n"


def _plan(plan: FloorPlan) -> doc.PlanDocument:
    return doc.PlanDocument.model_validate(
        {
            "rooms": [
                {"polygon_m": room.polygon.tolist(), "area_m2": room.area} for room in plan.rooms
            ],
            "walls": [
                {
                    "ends_m": wall.ends.tolist(),
                    "thickness_m": real(wall.thickness),
                    "probability": real(wall.probability),
                }
                for wall in plan.walls
            ],
            "doors_m": plan.doors.tolist(),
        }
    )


def _decision(item: DecisionOutcome) -> doc.DecisionDocument:
    decision = item.decision
    return doc.DecisionDocument.model_validate(
        {
            "kind": decision.kind,
            "a": decision.a,
            "b": decision.b,
            "decision": decision.verdict,
            "guess": None if decision.guess is None else _pose(decision.guess),
            "effect": item.effect,
            "contradiction": item.contradiction,
        }
    )


def _continued(item: Continuation) -> doc.ContinuationDocument:
    return doc.ContinuationDocument.model_validate(
        {
            "checksum": item.checksum,
            "added": [str(name) for name in item.added],
            "seen_from": item.seen_from,
            "moves": [
                {
                    "kind": move.kind,
                    "id": move.id,
                    "distance_m": real(move.distance),
                    "sigma_before_m": real(move.before),
                    "sigma_after_m": real(move.after),
                    "status_before": move.status_before,
                    "status_after": move.status_after,
                }
                for move in item.moves
            ],
        }
    )


def _rows(matrix: FloatArray | None) -> Any:
    return None if matrix is None else [[real(v) for v in row] for row in matrix.tolist()]


def _pose(pose: Pose2) -> doc.PoseDocument:
    return doc.PoseDocument(x_m=pose.x, y_m=pose.y, theta_rad=real(pose.theta))


def _alternatives(items: Iterable[Alternative]) -> list[doc.AlternativeDocument]:
    return [
        doc.AlternativeDocument(
            x_m=item.x, y_m=item.y, theta_rad=real(item.theta), weight=real(item.weight)
        )
        for item in items
    ]


def _station(item: StationEstimate) -> doc.StationDocument:
    return doc.StationDocument(
        id=item.id,
        world_T_station=None if item.pose is None else _pose(item.pose),
        covariance=_rows(item.covariance),
        status=item.status,
        heading_known=item.heading_known,
        alternatives=_alternatives(item.alternatives),
    )


def _anchor(item: AnchorEstimate) -> doc.AnchorDocument:
    return doc.AnchorDocument(
        id=item.id,
        position_m=None if item.position is None else (item.position[0], item.position[1]),
        covariance_m2=_rows(item.covariance),
        height_m=real(item.height),
        stations=int(item.stations),
        status=item.status,
        alternatives=_alternatives(item.alternatives),
    )


def _link(item: LinkMeasurement) -> doc.LinkDocument:
    return doc.LinkDocument(
        station=item.station,
        anchor=item.anchor,
        distance_m=real(item.distance),
        mean_m=real(item.mean),
        sigma_m=real(item.sigma),
        samples=int(item.samples),
        discarded=int(item.discarded),
        residual_m=real(item.residual),
        walls=real(item.walls),
        nlos_probability=real(item.nlos_probability),
        rejection=item.rejection,
    )


def _match(item: ScanMatch) -> doc.MatchDocument:
    return doc.MatchDocument(
        target=item.target,
        source=item.source,
        target_T_source=_pose(item.target_T_source),
        covariance=_rows(item.covariance),
        overlap=real(item.overlap),
        violation=real(item.violation),
        score=real(item.score),
        rank=int(item.rank),
        degenerate=bool(item.degenerate),
        rejection=item.rejection,
    )


def _bias(item: Bias) -> doc.BiasDocument:
    return doc.BiasDocument(
        name=item.name,
        mean_m=real(item.mean),
        sigma_m=real(item.sigma),
        prior_mean_m=real(item.prior_mean),
        prior_sigma_m=real(item.prior_sigma),
    )


def _checks(item: SolverChecks) -> doc.ChecksDocument:
    return doc.ChecksDocument(
        isam2_batch_gap_m=real(item.isam2_batch_gap),
        other_starts_gap_m=real(item.other_starts_gap),
        iterations=item.iterations,
        cost=real(item.cost),
    )


def _map(item: FloorMap) -> doc.MapDocument:
    height, width = item.occupancy.shape
    return doc.MapDocument(
        height=height,
        width=width,
        resolution_m=item.resolution,
        origin_m=item.origin,
        cells=pack(quantise(item.occupancy)),
    )


def _scan(name: str, scan: Scan) -> doc.ScanDocument:
    return doc.ScanDocument(
        station=name,
        bearings_rad=scan.bearings.tolist(),
        ranges_m=[real(value) for value in scan.ranges.tolist()],
        max_range_m=scan.max_range,
    )
