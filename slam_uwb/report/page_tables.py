"""The tables of the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..evaluate.estimates import Estimate, station_estimates
from ..model.geometry import Pose2
from ..model.products import LinkMeasurement, ScanMatch
from ..model.solution import Solution
from ..model.survey import StationId
from .moves import move_table
from .page_cells import Cell, Row, Table, build_table, count, metres, share, status_cell
from .page_map import link_kind
from .trust import SIGMAS, AnchorJudgement, Trust, describe_geometry, largest_two_sigma

_ENDS = {"pair": ("station", "station"), "link": ("station", "anchor")}
_SIGN = {Trust.YES: "✓", Trust.CHECK: "!", Trust.NO: "✗"}


def page_tables(solution: Solution, anchors: Sequence[AnchorJudgement]) -> tuple[Table, ...]:
    """Anchors, stations, links, matches and more; a table without rows is left out."""
    tables = (
        _anchor_table(anchors),
        _station_table(solution),
        _link_table(solution),
        _match_table(solution),
        _decision_table(solution),
        move_table(solution),
        _room_table(solution),
    )
    return tuple(table for table in tables if table.rows)


def _anchor_table(anchors: Sequence[AnchorJudgement]) -> Table:
    return build_table(
        "anchors",
        "Anchors",
        "Places and heights in metres. 2 sigma: half the long axis of the ellipse, which holds the true "
        "place in 86 of 100 cases. Through walls: share of the used links that cross a wall. RMS: of "
        "the residuals of the used links in line of sight. Geometry: the sector "
        "within which the stations stand that hear it, the wider the better.",
        "anchor|verdict|x|y|height|2 sigma|links used|rejected|through walls|RMS|geometry|status|"
        "other places",
        [_anchor_row(item) for item in anchors],
    )


def _anchor_row(item: AnchorJudgement) -> Row:
    anchor = item.anchor
    x, y = (None, None) if anchor.position is None else anchor.position.tolist()
    clear = [k.residual for k in item.used if link_kind(k) == "free" and math.isfinite(k.residual)]
    rms = math.sqrt(float(np.mean(np.square(clear)))) if clear else math.nan
    verdict = f"{_SIGN[item.trust]} {item.trust.value}"
    if item.why:
        verdict += f": {'; '.join(item.why)}"
    sector = None if math.isnan(item.open_angle) else math.tau - item.open_angle
    others = ", ".join(f"({p.x:.2f}, {p.y:.2f})" for p in anchor.alternatives)
    return Row(
        f"anchor:{anchor.id}",
        (
            Cell(anchor.id),
            Cell(verdict, mark={"✓": "fine", "!": "warn", "✗": "bad"}[_SIGN[item.trust]]),
            metres(x), metres(y), metres(anchor.height), metres(item.two_sigma),
            count(len(item.used)), count(len(item.rejected)), share(item.through_walls),
            metres(rms), Cell(describe_geometry(item), sector), status_cell(anchor.status), Cell(others),
        ),
    )  # fmt: skip


def _station_table(solution: Solution) -> Table:
    matched: dict[str, int] = {}
    for match in solution.matches:
        if match.rejection is None:
            for name in (match.target, match.source):
                matched[name] = matched.get(name, 0) + 1
    heard: dict[str, int] = {}
    for link in solution.links:
        heard[link.station] = heard.get(link.station, 0) + (link.rejection is None)
    return build_table(
        "stations",
        "Stations",
        "Places in metres, headings in degrees counter-clockwise from x. Matches: scans of other "
        "stations that hold it. Links: anchors whose ranges are used.",
        "station|x|y|heading|2 sigma|2 sigma heading|matches|links|status|other places",
        [_station_row(item, matched, heard) for item in station_estimates(solution)],
    )


def _station_row(item: Estimate, matched: dict[str, int], heard: dict[str, int]) -> Row:
    x, y = (None, None) if item.position is None else item.position.tolist()
    heading = math.degrees(item.heading) if math.isfinite(item.heading) else None
    turn = None
    if item.covariance is not None and len(item.covariance) == 3:
        turn = SIGMAS * math.degrees(math.sqrt(max(float(item.covariance[2, 2]), 0.0)))
    others = ", ".join(f"({p[0]:.2f}, {p[1]:.2f})" for p in item.alternatives)
    return Row(
        f"station:{item.id}",
        (
            Cell(item.id), metres(x), metres(y), metres(heading, 1),
            metres(largest_two_sigma(item.covariance), 3), metres(turn, 2),
            count(matched.get(item.id, 0)), count(heard.get(item.id, 0)), status_cell(item.status),
            Cell(others),
        ),
    )  # fmt: skip


def _link_table(solution: Solution) -> Table:
    return build_table(
        "links",
        "Links",
        "All ranges of one station to one anchor. Residual: measured minus predicted, metres; a wall "
        "makes it positive. Walls: expected number on the way.",
        "station|anchor|samples|range|residual|walls|through walls|used|reason",
        [_link_row(link) for link in solution.links],
    )


def _link_row(link: LinkMeasurement) -> Row:
    used = link.rejection is None
    return Row(
        f"station:{link.station} anchor:{link.anchor}",
        (
            Cell(link.station), Cell(link.anchor), count(link.samples), metres(link.distance),
            metres(link.residual, 3, "+"), metres(link.walls, 1), share(link.nlos_probability),
            Cell("yes" if used else "no", mark="" if used else "bad"), Cell(link.rejection or ""),
        ),
    )  # fmt: skip


def _match_table(solution: Solution) -> Table:
    poses = {item.id: item.pose for item in solution.stations if item.pose is not None}
    rows = [_match_row(match, poses) for match in solution.matches]
    # What is used first, then by pair and rank as matches.csv has it.
    rows.sort(key=lambda row: row.quiet)
    return build_table(
        "matches",
        "Scan matches",
        "How the scan of n lies to that of m. Overlap: share of the walls that both saw; violation: share "
        "that the other one looked through. Strength: 1 sigma along the strongest and the weakest "
        "direction of n, and that direction. Residual: how far the result is from the match.",
        "m|n|rank|dx|dy|turn|overlap|violation|strength|residual|used|reason",
        rows,
        more="also show the hypotheses that were not used",
    )


def _match_row(match: ScanMatch, poses: Mapping[StationId, Pose2]) -> Row:
    used = match.rejection is None
    pose = match.target_T_source
    residual = math.nan
    if match.target in poses and match.source in poses:
        placed = poses[match.target].inverse() @ poses[match.source]
        residual = pose.distance_to(placed)
    return Row(
        f"station:{match.target} station:{match.source}",
        (
            Cell(match.target), Cell(match.source), count(match.rank), metres(pose.x),
            metres(pose.y), metres(math.degrees(pose.theta), 1), share(match.overlap),
            share(match.violation), _strength(match), metres(residual, 3),
            Cell("yes" if used else "no", mark="" if used else "off"), Cell(match.rejection or ""),
        ),
        quiet=not used,
    )  # fmt: skip


def _decision_table(solution: Solution) -> Table:
    rows = [
        Row(
            " ".join(f"{k}:{n}" for k, n in zip(_ENDS[d.kind], (d.a, d.b), strict=True)),
            (
                Cell(d.kind), Cell(d.a), Cell(d.b), Cell(d.verdict), Cell(outcome.effect),
                Cell(outcome.contradiction or "", mark="bad" if outcome.contradiction else ""),
            ),
        )
        for outcome in solution.decisions
        for d in [outcome.decision]
    ]  # fmt: skip
    return build_table(
        "decisions",
        "Decisions",
        "What decisions.csv of the survey says, what was done, and what in the data speaks against it.",
        "kind|a|b|decision|effect|but",
        rows,
    )


def _room_table(solution: Solution) -> Table:
    rooms = solution.plan.rooms if solution.plan else ()
    rows = []
    for number, room in enumerate(rooms, 1):
        sides = np.linalg.norm(np.roll(room.polygon, -1, axis=0) - room.polygon, axis=1)
        walls = ", ".join(f"{side:.2f}" for side in sides)
        cells = (count(number), metres(room.area, 1), metres(float(sides.sum())), Cell(walls))
        rows.append(Row(f"room:{number}", cells))
    return build_table(
        "rooms",
        "Rooms",
        "Closed rooms between wall faces, square metres and metres; a door counts as wall.",
        "room|area|perimeter|walls in turn",
        rows,
    )


def _strength(match: ScanMatch) -> Cell:
    """Sigmas along the principal axes of the translation, sorted by the weakest."""
    if not np.isfinite(match.covariance[:2, :2]).all():
        return Cell("")
    values, axes = np.linalg.eigh(match.covariance[:2, :2])
    strong, weak = np.sqrt(np.maximum(values, 0.0))
    degrees = math.degrees(math.atan2(axes[1, 1], axes[0, 1])) % 180.0
    text = f"{1000 * strong:.1f} mm, {1000 * weak:.1f} mm at {degrees:.0f}°"
    if match.degenerate:
        text = f"{1000 * strong:.1f} mm, free along {degrees:.0f}°"
    return Cell(text, float(weak))
