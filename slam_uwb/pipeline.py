"""The whole method on one page: a survey in, a solution out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from ._version import __version__
from .continuation import earlier_matches, require_fit, what_moved
from .graph import SOLVERS, adjust_placement
from .mapping import build_floor_map, build_floor_plan, find_walls
from .matching import (
    Selection,
    candidate_pairs,
    decide_pairs,
    index_scans,
    match_pairs,
    review_pairs,
    select_matches,
)
from .model.errors import DisconnectedSurveyError, SlamUwbError
from .model.frame_change import (
    Alignment,
    DrawnPlan,
    change_frame,
    fit_frame,
    fit_picture,
    main_direction,
    misfits,
)
from .model.geometry import Pose2
from .model.products import (
    GraphProblem,
    LinkMeasurement,
    Progress,
    ScanMatch,
    WallPieces,
    silent,
)
from .model.settings import GraphSettings, Settings
from .model.solution import (
    Alternative,
    DecisionOutcome,
    FloorMap,
    FloorPlan,
    GraphEstimate,
    Solution,
    StationEstimate,
    Status,
)
from .model.survey import Scan, StationId, Survey
from .ranging import (
    decide_links,
    keep_links,
    least_separation,
    link_model,
    range_gain,
    reduce_anchor_links,
    reduce_links,
    review_links,
)
from .scan import prepare_scan, reduce_scan


def solve_survey(
    survey: Survey,
    settings: Settings | None = None,
    *,
    use_ranges: bool = True,
    align: Alignment | None = None,
    earlier: Solution | None = None,
    progress: Progress = silent,
    workers: int = 1,
) -> Solution:
    """Estimate the floor map, the stations' poses and the anchors' places of one survey.

    Args:
        survey: What was measured.
        settings: Knobs of all steps; the defaults where None.
        use_ranges: False leaves the UWB ranges out: poses and map from the scans alone.
        align: `walls` turns the frame so that the main walls run along its axes; known places (x, y) m
            of two or more stations and anchors move it there, and so do their pixels in a picture of
            the floor. A frame that the survey's own control points fix stays.
        earlier: Solution of the same survey before it had its latest stations. Only pairs of new
            stations are matched; the matches that held the earlier map together are used as they are,
            and its frame stays aligned as it was where `align` says nothing else.
        progress: Called with what is being done, how much of it is done, and how much there is.
        workers: Processes that match scans; the result does not depend on it.

    Returns:
        Places with covariances in the frame of the first placed station, or the site's where
        control points fix it.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
        SettingsError: a sequence is wanted and the survey has none.
        SlamUwbError: the earlier solution rests on what has changed since.
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
    if earlier is not None:
        require_fit(earlier, survey, settings, reduced, links)
    known = earlier_matches(earlier)
    links = decide_links(links, survey.decisions)

    indexed = index_scans(scans, settings.matching)
    separation = least_separation(tuple(indexed), links) if links else None
    pairs = candidate_pairs(tuple(indexed), survey.sequence, settings.matching, separation)
    found = match_pairs(known.unmatched(pairs), indexed, settings.matching, progress, workers)
    hypotheses = (*known.hypotheses, *found)
    decided = decide_pairs(survey.decisions, pairs, hypotheses, indexed, settings.matching)
    selection = select_matches(
        indexed,
        decided.hypotheses,
        known.open(decided.pairs),
        settings.matching,
        adjust=adjust_placement,
        firm=known.firm(decided.firm),
        range_gain=range_gain(survey, links),
        progress=progress,
    )
    walls_at = partial(find_walls, scans, settings=settings.mapping, upper_scans=upper_scans)
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
        link_model=link_model(settings.ranging, walls_at if scans else None),
    )
    progress("estimating poses and anchors", 0, 1)
    estimate = _solve(problem, settings.graph, selection)
    progress("estimating poses and anchors", 1, 1)
    aligned_T_world, picture = _alignment(estimate, align, earlier, walls_at, settings)
    if aligned_T_world is not None:
        estimate = change_frame(estimate, aligned_T_world)

    poses = {s.id: s.pose for s in estimate.stations if s.pose is not None and s.id in scans}
    floor_map = build_floor_map(scans, poses, settings.mapping) if poses else None
    plan = build_floor_plan(walls_at(poses), floor_map, settings.mapping) if floor_map else None
    outcomes = (
        *review_pairs(survey.decisions, decided, selection.placement, settings.matching),
        *review_links(survey.decisions, estimate.links),
    )
    estimate = _with_links(estimate, keep_links(estimate.links, survey.decisions))
    matches = (*selection.matches, *decided.dropped)
    continued = None if earlier is None else what_moved(earlier, estimate, aligned_T_world)
    solution = _solution(
        survey, settings, estimate, matches, floor_map, plan, reduced, outcomes, aligned_T_world
    )
    warnings = (*solution.warnings, *misfits(estimate, align, picture))
    return replace(solution, continued=continued, picture=picture, warnings=warnings)


def _alignment(
    estimate: GraphEstimate,
    align: Alignment | None,
    earlier: Solution | None,
    walls_at: Callable[[Mapping[StationId, Pose2]], WallPieces],
    settings: Settings,
) -> tuple[Pose2 | None, FloorMap | None]:
    """aligned_T_world and the picture it is aligned to; None where nothing is asked for."""
    if align is None:
        same = earlier is not None and earlier.frame == estimate.frame
        return (
            (earlier.alignment, earlier.picture) if earlier is not None and same else (None, None)
        )
    if estimate.frame == "site":
        raise SlamUwbError("--align: the survey's control points fix the frame already")
    if isinstance(align, DrawnPlan):
        return fit_picture(estimate, align)
    if not isinstance(align, str):
        return fit_frame(estimate, align), None
    walls = walls_at({s.id: s.pose for s in estimate.stations if s.pose is not None})
    ends = walls.ends[walls.probability >= settings.mapping.room_wall_probability]
    return Pose2(0.0, 0.0, -main_direction(ends)) if len(ends) else None, None


def _with_links(estimate: GraphEstimate, links: tuple[LinkMeasurement, ...]) -> GraphEstimate:
    """The estimate with links whose use has changed, and the anchors' counts of them."""
    anchors = tuple(
        replace(a, stations=sum(k.anchor == a.id and k.rejection is None for k in links))
        for a in estimate.anchors
    )
    return replace(estimate, links=links, anchors=anchors)


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
    plan: FloorPlan | None,
    scans: Mapping[StationId, Scan],
    decisions: tuple[DecisionOutcome, ...],
    aligned_T_world: Pose2 | None,
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
        plan=plan,
        scans=scans,
        tag_offset=survey.tag_offset,
        warnings=tuple(
            f"decisions.csv: {d.kind} {d.a}, {d.b}: {d.verdict}, {outcome.effect}, although "
            f"{outcome.contradiction}"
            for outcome in decisions
            if outcome.contradiction is not None
            for d in [outcome.decision]
        ),
        decisions=decisions,
        alignment=aligned_T_world,
        tag_heights={s.id: s.tag_height for s in survey.stations if math.isfinite(s.tag_height)},
    )
