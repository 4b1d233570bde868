"""The whole method on one page: a survey in, a solution out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from ._version import __version__
from .continuation import Earlier, earlier_matches, require_fit, what_moved
from .graph import SOLVERS, adjust_placement
from .mapping import build_floor_map, build_floor_plan, find_walls
from .matching import (
    DecidedPairs,
    Selection,
    candidate_pairs,
    decide_pairs,
    index_scans,
    match_pairs,
    name_ambiguous,
    repeating_building,
    review_pairs,
    select_matches,
)
from .model.errors import DisconnectedSurveyError, SlamUwbError
from .model.floor import FloorMap, FloorPlan
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
    PreparedScan,
    Progress,
    ScanMatch,
    Share,
    WallPieces,
    alone,
    silent,
)
from .model.settings import (
    GraphSettings,
    MappingSettings,
    MatchingSettings,
    ScanSettings,
    Settings,
)
from .model.solution import DecisionOutcome, GraphEstimate, Solution
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

WallsAt = Callable[[Mapping[StationId, Pose2]], WallPieces]
"""The walls that the survey's scans show from world_T_station."""


def solve_survey(
    survey: Survey,
    settings: Settings | None = None,
    *,
    use_ranges: bool = True,
    align: Alignment | None = None,
    earlier: Solution | None = None,
    progress: Progress = silent,
    share: Share = alone,
) -> Solution:
    """Estimate the floor map, the stations' poses and the anchors' places of one survey.

    Args:
        survey: What was measured.
        settings: Knobs of all steps; the defaults where None.
        use_ranges: False leaves the UWB ranges out: poses and map from the scans alone.
        align: `walls` turns the frame so that the main walls run along its axes; known places (x, y) m
            of two or more stations and anchors move it there, and so do their pixels in a picture of
            the floor. Refused where the survey's own control points fix the frame.
        earlier: Solution of the same survey before it had its latest stations. Only pairs of new
            stations are matched; the matches that held the earlier map together are used as they are,
            and its frame stays aligned as it was where `align` says nothing else.
        progress: Called with what is being done, how much of it is done, and how much there is.
        share: How work is shared out among processes (`sharing`); the result does not depend on it.

    Returns:
        Places with covariances in the frame of the first placed station, or the site's where
        control points fix it.

    Raises:
        DisconnectedSurveyError: no two stations hold together and no site frame exists.
        SettingsError: a sequence is wanted and the survey has none.
        SlamUwbError: the frame cannot be aligned as asked, or the earlier solution rests on what has
            changed since.
        SolverError: the joint problem could not be solved.
    """
    settings = settings or Settings()
    survey = survey if use_ranges else survey.without_ranges()
    # Each recording and each link alone.
    reduced, scans, upper_scans = _prepare(survey, settings, share)
    links = reduce_links(survey, settings.ranging)
    if earlier is not None:
        require_fit(earlier, survey, settings, reduced, links)
    links = decide_links(links, survey.decisions)
    # Which scans hold together, and how.
    known = earlier_matches(earlier)
    decided, selection = _match(survey, scans, links, known, settings.matching, progress, share)
    # Where the stations and the anchors are.
    walls_at = partial(find_walls, scans, settings=settings.mapping, upper_scans=upper_scans)
    problem = _problem(survey, selection, links, settings, walls_at if scans else None)
    estimate = _solve(problem, settings.graph, selection, progress, share)
    aligned_T_world, picture = _alignment(estimate, align, earlier, walls_at, settings.mapping)
    if aligned_T_world is not None:
        estimate = change_frame(estimate, aligned_T_world)
    # What the building looks like.
    floor_map, plan = _draw(scans, estimate.poses, walls_at, settings.mapping)
    # What became of what a person decided.
    outcomes = (
        *review_pairs(survey.decisions, decided, selection.placement, settings.matching),
        *review_links(survey.decisions, estimate.links),
    )
    estimate = estimate.with_links(keep_links(estimate.links, survey.decisions))
    matches = (*selection.matches, *decided.dropped)
    continued = None if earlier is None else what_moved(earlier, estimate, aligned_T_world)
    solution = _solution(
        survey, settings, estimate, matches, floor_map, plan, reduced, outcomes, aligned_T_world
    )
    warnings = (*solution.warnings, *misfits(estimate, align, picture))
    return replace(solution, continued=continued, picture=picture, warnings=warnings)


def _prepare(
    survey: Survey, settings: Settings, share: Share
) -> tuple[dict[StationId, Scan], dict[StationId, PreparedScan], dict[StationId, PreparedScan]]:
    """Scans reduced to one sample an angle bin, described, and the described upper ones."""
    # By name, not in the survey's order: which scan is fitted to which must not depend on it.
    stations = sorted(survey.stations, key=lambda station: station.id)
    landmarks = settings.matching.initialiser == "landmark"
    prepare = partial(prepare_scan, settings=settings.scan, landmarks=landmarks)
    recorded = [(s.id, s.scan) for s in stations if s.scan is not None]
    made = list(share(partial(_reduced_and_prepared, settings.scan, prepare), recorded))
    return (
        {name: reduced for (name, _), (reduced, _) in zip(recorded, made, strict=True)},
        {name: scan for (name, _), (_, scan) in zip(recorded, made, strict=True)},
        {s.id: prepare(s.id, s.upper_scan) for s in stations if s.upper_scan is not None},
    )


def _reduced_and_prepared(
    settings: ScanSettings,
    prepare: Callable[[StationId, Scan], PreparedScan],
    recorded: tuple[StationId, Scan],
) -> tuple[Scan, PreparedScan]:
    station, scan = recorded
    reduced = reduce_scan(scan, settings)
    return reduced, prepare(station, reduced)


def _match(
    survey: Survey,
    prepared: Mapping[StationId, PreparedScan],
    links: Sequence[LinkMeasurement],
    known: Earlier,
    settings: MatchingSettings,
    progress: Progress,
    share: Share,
) -> tuple[DecidedPairs, Selection]:
    """What a person decided of the pairs, and the hypotheses that hold together."""
    scans = index_scans(prepared, settings)
    separation = least_separation(tuple(scans), links)
    pairs = candidate_pairs(tuple(scans), survey.sequence, settings, separation)
    found = match_pairs(known.unmatched(pairs), scans, settings, progress, share)
    hypotheses = (*known.hypotheses, *found)
    decided = decide_pairs(survey.decisions, pairs, hypotheses, scans, settings)
    selection = select_matches(
        scans,
        decided.hypotheses,
        known.open(decided.pairs),
        settings,
        adjust=adjust_placement,
        firm=known.firm(decided.firm),
        range_gain=range_gain(survey, links),
        progress=progress,
        share=share,
    )
    return decided, selection


def _problem(
    survey: Survey,
    selection: Selection,
    links: tuple[LinkMeasurement, ...],
    settings: Settings,
    walls_at: WallsAt | None,
) -> GraphProblem:
    """What holds together and what was measured, as the solvers are given it."""
    return GraphProblem(
        stations=survey.stations,
        anchors=survey.anchors,
        matches=selection.used,
        placement=selection.placement,
        links=links,
        anchor_links=reduce_anchor_links(survey, settings.ranging),
        tag_offset=survey.tag_offset,
        range_offset=survey.range_offset,
        sequence=survey.sequence,
        link_model=link_model(settings.ranging, walls_at),
    )


def _solve(
    problem: GraphProblem,
    settings: GraphSettings,
    selection: Selection,
    progress: Progress,
    share: Share,
) -> GraphEstimate:
    """The solver's estimate, with the stations that matching found to fit at several places named so."""
    progress("estimating poses and anchors", 0, 1)
    try:
        estimate = SOLVERS[settings.mode](problem, settings, share)
    except DisconnectedSurveyError as error:
        if selection.ambiguous:
            raise repeating_building(selection) from error
        raise
    progress("estimating poses and anchors", 1, 1)
    return name_ambiguous(estimate, selection)


def _alignment(
    estimate: GraphEstimate,
    align: Alignment | None,
    earlier: Solution | None,
    walls_at: WallsAt,
    settings: MappingSettings,
) -> tuple[Pose2 | None, FloorMap | None]:
    """aligned_T_world and the picture it is aligned to; None where nothing is asked for, or to align with."""
    if align is None:
        same = earlier is not None and earlier.frame == estimate.frame
        return (earlier.alignment, earlier.picture) if earlier and same else (None, None)
    if estimate.frame == "site":
        raise SlamUwbError("--align: the survey's control points fix the frame already")
    if isinstance(align, DrawnPlan):
        return fit_picture(estimate, align)
    if not isinstance(align, str):
        return fit_frame(estimate, align), None
    walls = walls_at(estimate.poses)
    ends = walls.ends[walls.probability >= settings.room_wall_probability]
    return Pose2(0.0, 0.0, -main_direction(ends)) if len(ends) else None, None


def _draw(
    scans: Mapping[StationId, PreparedScan],
    world_T_station: Mapping[StationId, Pose2],
    walls_at: WallsAt,
    settings: MappingSettings,
) -> tuple[FloorMap | None, FloorPlan | None]:
    """Map and plan from the stations that have a scan and a place; None where none has."""
    poses = {station: pose for station, pose in world_T_station.items() if station in scans}
    if not poses:
        return None, None
    floor_map = build_floor_map(scans, poses, settings)
    return floor_map, build_floor_plan(walls_at(poses), floor_map, settings)


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
    """All of it as it is delivered."""
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
        warnings=tuple(d.warning for d in decisions if d.warning is not None),
        decisions=decisions,
        alignment=aligned_T_world,
        tag_heights={s.id: s.tag_height for s in survey.stations if math.isfinite(s.tag_height)},
    )
