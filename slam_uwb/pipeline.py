"""The whole method on one page: a survey in, a solution out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from ._version import __version__
from .graph import SOLVERS, adjust_placement
from .mapping import build_floor_map, find_walls
from .matching import Selection, candidate_pairs, index_scans, match_pairs, select_matches
from .model.errors import DisconnectedSurveyError
from .model.geometry import Pose2
from .model.products import GraphProblem, Progress, ScanMatch, silent
from .model.settings import GraphSettings, Settings
from .model.solution import (
    Alternative,
    FloorMap,
    GraphEstimate,
    Solution,
    StationEstimate,
    Status,
)
from .model.survey import Scan, StationId, Survey
from .ranging import (
    least_separation,
    link_model,
    range_gain,
    reduce_anchor_links,
    reduce_links,
)
from .scan import prepare_scan, reduce_scan


def solve_survey(
    survey: Survey,
    settings: Settings | None = None,
    *,
    use_ranges: bool = True,
    progress: Progress = silent,
    workers: int = 1,
) -> Solution:
    """Estimate the floor map, the stations' poses and the anchors' places of one survey.

    Args:
        survey: What was measured.
        settings: Knobs of all steps; the defaults where None.
        use_ranges: False leaves the UWB ranges out: poses and map from the scans alone.
        progress: Called with what is being done, how much of it is done, and how much there is.
        workers: Processes that match scans; the result does not depend on it.

    Returns:
        Places with covariances in the frame of the first placed station, or the site's where
        control points fix it.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
        SettingsError: a sequence is wanted and the survey has none.
    """
    settings = settings or Settings()
    # By name, not in the survey's order: which scan is fitted to which must not depend on it.
    stations = sorted(survey.stations, key=lambda station: station.id)
    reduced = {s.id: reduce_scan(s.scan, settings.scan) for s in stations if s.scan is not None}
    scans = {name: prepare_scan(name, scan, settings.scan) for name, scan in reduced.items()}
    upper_scans = {
        s.id: prepare_scan(s.id, s.upper_scan, settings.scan)
        for s in stations
        if s.upper_scan is not None
    }
    links = reduce_links(survey, settings.ranging) if use_ranges else ()

    indexed = index_scans(scans, settings.matching)
    separation = least_separation(tuple(indexed), links) if links else None
    pairs = candidate_pairs(tuple(indexed), survey.sequence, settings.matching, separation)
    hypotheses = match_pairs(pairs, indexed, settings.matching, progress, workers)
    selection = select_matches(
        indexed,
        hypotheses,
        pairs,
        settings.matching,
        adjust=adjust_placement,
        range_gain=range_gain(survey, links),
        progress=progress,
    )
    problem = GraphProblem(
        stations=survey.stations,
        anchors=survey.anchors,
        matches=selection.used,
        placement=selection.placement,
        links=links,
        anchor_links=reduce_anchor_links(survey, settings.ranging) if use_ranges else (),
        tag_offset=survey.tag_offset,
        range_offset=survey.range_offset,
        sequence=survey.sequence,
        link_model=link_model(
            settings.ranging,
            partial(find_walls, scans, settings=settings.mapping, upper_scans=upper_scans)
            if scans
            else None,
        ),
    )
    progress("estimating poses and anchors", 0, 1)
    estimate = _solve(problem, settings.graph, selection)
    progress("estimating poses and anchors", 1, 1)

    poses = {s.id: s.pose for s in estimate.stations if s.pose is not None and s.id in scans}
    floor_map = build_floor_map(scans, poses, settings.mapping) if poses else None
    return _solution(survey, settings, estimate, selection.matches, floor_map, reduced)


def _solve(problem: GraphProblem, settings: GraphSettings, selection: Selection) -> GraphEstimate:
    """The solver's estimate, with the stations that matching found to fit at several places named so."""
    try:
        estimate = SOLVERS[settings.mode](problem, settings)
    except DisconnectedSurveyError as error:
        if not selection.ambiguous:
            raise
        names = ", ".join(selection.ambiguous)
        raise DisconnectedSurveyError(
            f"every station fits at more than one place ({names}): the building repeats itself; "
            "ranges to anchors or a surveyed station would tell"
        ) from error
    shared = [
        station.pose @ selection.placement[station.id].inverse()
        for station in estimate.stations
        if station.pose is not None and station.id in selection.placement
    ]
    if not shared:
        return estimate
    world_T_placement = shared[0]
    stations = tuple(
        _ambiguous(station, selection.ambiguous[station.id], world_T_placement)
        if station.id in selection.ambiguous and station.pose is None
        else station
        for station in estimate.stations
    )
    return replace(estimate, stations=stations)


def _ambiguous(
    station: StationEstimate, places: tuple[tuple[Pose2, float], ...], world_T_placement: Pose2
) -> StationEstimate:
    poses = [(world_T_placement @ pose, weight) for pose, weight in places]
    alternatives = tuple(Alternative(p.x, p.y, p.theta, weight) for p, weight in poses)
    return replace(station, status=Status.AMBIGUOUS, alternatives=alternatives)


def _solution(
    survey: Survey,
    settings: Settings,
    estimate: GraphEstimate,
    matches: tuple[ScanMatch, ...],
    floor_map: FloorMap | None,
    scans: Mapping[StationId, Scan],
) -> Solution:
    return Solution(
        survey_name=survey.name,
        checksum=survey.checksum,
        mode=settings.graph.mode,
        settings=settings,
        software_version=__version__,
        frame=estimate.frame,
        stations=estimate.stations,
        anchors=estimate.anchors,
        matches=matches,
        links=estimate.links,
        biases=estimate.biases,
        joint_names=estimate.joint_names,
        joint_covariance=estimate.joint_covariance,
        checks=estimate.checks,
        floor_map=floor_map,
        scans=scans,
        tag_offset=survey.tag_offset,
        warnings=("decisions.csv is read, but not obeyed yet",) if survey.decisions else (),
    )
