"""The steps of `solve_survey` one by one, each with what it needs of the ones before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from slam_uwb.graph import SOLVERS, adjust_placement
from slam_uwb.io import read_survey, write_solution
from slam_uwb.mapping import build_floor_map, build_floor_plan, find_walls
from slam_uwb.matching import candidate_pairs, index_scans, match_pairs, select_matches
from slam_uwb.model.products import GraphProblem
from slam_uwb.model.settings import Settings
from slam_uwb.pipeline import solve_survey
from slam_uwb.ranging import least_separation, link_model, range_gain, reduce_links
from slam_uwb.report.pictures import solution_pictures
from slam_uwb.scan import prepare_scan, reduce_scan

SETTINGS = Settings()


@dataclass
class Site:
    """One survey folder, and what each stage made of it."""

    stations: int
    folder: Path
    scratch: Path
    made: dict[str, Any] = field(default_factory=dict)

    def need(self, stage: str) -> Any:
        """The result of a stage; made once."""
        if stage not in self.made:
            self.made[stage] = STAGES[stage](self)
        return self.made[stage]


def _read(site: Site) -> Any:
    return read_survey(site.folder)


def _prepare(site: Site) -> Any:
    stations = sorted(site.need("reading").stations, key=lambda s: s.id)
    return {
        s.id: prepare_scan(s.id, reduce_scan(s.scan, SETTINGS.scan), SETTINGS.scan)
        for s in stations
        if s.scan is not None
    }


def _match(site: Site) -> Any:
    survey, scans = site.need("reading"), site.need("scan preparation")
    indexed = index_scans(scans, SETTINGS.matching)
    links = reduce_links(survey, SETTINGS.ranging)
    apart = least_separation(tuple(indexed), links) if links else None
    pairs = candidate_pairs(tuple(indexed), survey.sequence, SETTINGS.matching, apart)
    return indexed, links, pairs, match_pairs(pairs, indexed, SETTINGS.matching)


def _select(site: Site) -> Any:
    indexed, links, pairs, hypotheses = site.need("pair matching")
    return select_matches(
        indexed, hypotheses, pairs, SETTINGS.matching,
        adjust=adjust_placement, firm=(), range_gain=range_gain(site.need("reading"), links),
    )  # fmt: skip


def _solve(site: Site) -> Any:
    survey, selection = site.need("reading"), site.need("consistency")
    walls_at = partial(find_walls, site.need("scan preparation"), settings=SETTINGS.mapping)
    problem = GraphProblem(
        stations=survey.stations,
        anchors=survey.anchors,
        matches=selection.used,
        placement=selection.placement,
        links=site.need("pair matching")[1],
        tag_offset=survey.tag_offset,
        range_offset=survey.range_offset,
        sequence=survey.sequence,
        link_model=link_model(SETTINGS.ranging, walls_at),
    )
    return SOLVERS[SETTINGS.graph.mode](problem, SETTINGS.graph)


def _map(site: Site) -> Any:
    scans, estimate = site.need("scan preparation"), site.need("joint solve")
    poses = {s.id: s.pose for s in estimate.stations if s.pose is not None and s.id in scans}
    floor_map = build_floor_map(scans, poses, SETTINGS.mapping)
    walls = find_walls(scans, poses, settings=SETTINGS.mapping)
    return floor_map, build_floor_plan(walls, floor_map, SETTINGS.mapping)


def _report(site: Site) -> Any:
    solution = site.need("solution")
    write_solution(solution, site.scratch / "solution", extras=solution_pictures(solution))


def _solution(site: Site) -> Any:
    return solve_survey(site.need("reading"), SETTINGS)


STAGES: dict[str, Callable[[Site], Any]] = {
    "reading": _read,
    "scan preparation": _prepare,
    "pair matching": _match,
    "consistency": _select,
    "joint solve": _solve,
    "map": _map,
    "solution": _solution,
    "report": _report,
}
"""In their order; `solution` is all of them but reading and report, for the sake of its result."""
MEASURED = tuple(name for name in STAGES if name != "solution")
