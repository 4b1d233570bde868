"""A survey matched once, and as many estimates of it as a table wants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from slam_uwb import Reference, Settings, Solution, Survey, solve_survey
from slam_uwb.graph import SOLVERS
from slam_uwb.mapping import find_walls
from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.link_law import LinkModel
from slam_uwb.model.products import GraphProblem, LinkMeasurement
from slam_uwb.model.settings import GraphSettings
from slam_uwb.ranging import link_model, reduce_anchor_links, reduce_links
from slam_uwb.scan import prepare_scan


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """What `solve_survey` made of a survey, and the problem that its solver was given."""

    solution: Solution
    problem: GraphProblem
    """With the walls that the scans show behind its link model."""
    reference: Reference

    def solved(self, settings: GraphSettings, model: LinkModel | None = None) -> Solution | None:
        """The solution by other settings, or by another model of the links; None where there is none."""
        problem = self.problem if model is None else replace(self.problem, link_model=model)
        try:
            estimate = SOLVERS[settings.mode](problem, settings)
        except SlamUwbError:
            return None
        return replace(
            self.solution,
            mode=settings.mode,
            frame=estimate.frame,
            stations=estimate.stations,
            anchors=estimate.anchors,
            links=estimate.links,
            biases=estimate.biases,
            joint_names=estimate.joint_names,
            joint_covariance=estimate.joint_covariance,
            checks=estimate.checks,
        )

    def with_links(self, links: Sequence[LinkMeasurement]) -> Matched:
        """The same matches with other ranges."""
        return replace(self, problem=replace(self.problem, links=tuple(links)))


def match_survey(survey: Survey, reference: Reference, settings: Settings) -> Matched:
    """Solve a survey and keep what holds together.

    Raises:
        SlamUwbError: the survey cannot be solved.
    """
    solution = solve_survey(survey, settings)
    scans = {n: prepare_scan(n, scan, settings.scan) for n, scan in solution.scans.items()}
    upper = {
        s.id: prepare_scan(s.id, s.upper_scan, settings.scan)
        for s in survey.stations
        if s.upper_scan is not None
    }
    walls_at = partial(find_walls, scans, settings=settings.mapping, upper_scans=upper)
    matches = tuple(match for match in solution.matches if match.rejection is None)
    matched = {name for match in matches for name in match.ends}
    problem = GraphProblem(
        stations=survey.stations,
        anchors=survey.anchors,
        matches=matches,
        placement={
            s.id: s.pose for s in solution.stations if s.pose is not None and s.id in matched
        },
        links=reduce_links(survey, settings.ranging),
        anchor_links=reduce_anchor_links(survey, settings.ranging),
        tag_offset=survey.tag_offset,
        range_offset=survey.range_offset,
        sequence=survey.sequence,
        link_model=link_model(settings.ranging, walls_at if scans else None),
    )
    return Matched(solution, problem, reference)
