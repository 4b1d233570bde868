"""The tables of the report: cells of text with what they sort by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..evaluate.estimates import Estimate, station_estimates
from ..model.geometry import Pose2
from ..model.products import LinkMeasurement, ScanMatch
from ..model.solution import Solution, Status
from ..model.survey import StationId
from .page_map import link_kind
from .trust import SIGMAS, AnchorJudgement, Trust, describe_geometry, largest_two_sigma

_MOST_ROWS = 3000
"""Of one table: a page of a building with hundreds of stations must still open on a phone."""
_ENDS = {"pair": ("station", "station"), "link": ("station", "anchor")}
_SIGN = {Trust.YES: "✓", Trust.CHECK: "!", Trust.NO: "✗"}


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell; a number sorts by its value, whatever its text."""

    text: str
    value: float | None = None
    mark: str = ""
    """CSS class."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row; `key` ties it to its mark on the map."""

    key: str
    cells: tuple[Cell, ...]
    quiet: bool = False
    """What is hidden until all rows are asked for."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table with a line that explains its columns."""

    name: str
    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    left_out: int = 0
    """Rows beyond the limit; the CSV files of the solution have them."""
    more: str = ""
    """What the quiet rows are called; empty where there are none."""


def page_tables(solution: Solution, anchors: Sequence[AnchorJudgement]) -> tuple[Table, ...]:
    """Anchors, stations, links and matches; a table without rows is left out."""
    tables = (
        _anchor_table(anchors),
        _station_table(solution),
        _link_table(solution),
        _match_table(solution),
        _decision_table(solution),
        _room_table(solution),
    )
    return tuple(table for table in tables if table.rows)


def metres(value: float | None, decimals: int = 2, sign: str = "") -> Cell:
    """A length, empty where it is not known."""
    if value is None or not math.isfinite(value):
        return Cell("")
    # Adding zero turns the -0.0 that rounding makes of small negative numbers into 0.0.
    return Cell(f"{round(float(value), decimals) + 0.0:{sign}.{decimals}f}", float(value))


def share(value: float) -> Cell:
    """A share 0-1 in per cent."""
    return Cell(f"{100.0 * value:.0f} %", value) if math.isfinite(value) else Cell("")


def _count(number: int) -> Cell:
    return Cell(str(number), float(number))


def _status(status: Status) -> Cell:
    return Cell(status.value, mark="fine" if status is Status.OK else "bad")


def _table(
    name: str, title: str, note: str, columns: str, rows: Sequence[Row], more: str = ""
) -> Table:
    shown = rows[:_MOST_ROWS]
    # A column that says nothing costs a phone a third of its width.
    filled = [k for k, _ in enumerate(columns.split("|")) if any(r.cells[k].text for r in shown)]
    titles = columns.split("|")
    return Table(
        name,
        title,
        note,
        tuple(titles[k] for k in filled),
        tuple(replace(row, cells=tuple(row.cells[k] for k in filled)) for row in shown),
        len(rows) - len(shown),
        more,
    )


def _anchor_table(anchors: Sequence[AnchorJudgement]) -> Table:
    return _table(
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
            _count(len(item.used)), _count(len(item.rejected)), share(item.through_walls),
            metres(rms), Cell(describe_geometry(item), sector), _status(anchor.status), Cell(others),
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
    return _table(
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
            _count(matched.get(item.id, 0)), _count(heard.get(item.id, 0)), _status(item.status),
            Cell(others),
        ),
    )  # fmt: skip


def _link_table(solution: Solution) -> Table:
    return _table(
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
            Cell(link.station), Cell(link.anchor), _count(link.samples), metres(link.distance),
            metres(link.residual, 3, "+"), metres(link.walls, 1), share(link.nlos_probability),
            Cell("yes" if used else "no", mark="" if used else "bad"), Cell(link.rejection or ""),
        ),
    )  # fmt: skip


def _match_table(solution: Solution) -> Table:
    poses = {item.id: item.pose for item in solution.stations if item.pose is not None}
    rows = [_match_row(match, poses) for match in solution.matches]
    # What is used first, then by pair and rank as matches.csv has it.
    rows.sort(key=lambda row: row.quiet)
    return _table(
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
            Cell(match.target), Cell(match.source), _count(match.rank), metres(pose.x),
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
    return _table(
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
        cells = (_count(number), metres(room.area, 1), metres(float(sides.sum())), Cell(walls))
        rows.append(Row(f"room:{number}", cells))
    return _table(
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
