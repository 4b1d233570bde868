"""An evaluation as plain values for programs and as text for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..model.solution import Status
from .evaluation import ErrorSummary, Evaluation, GroupEvaluation, ItemEvaluation

_ALIGNED_ON = {
    "site": "none needed, both are in the site's frame",
    "stations": "rigid, without scale, on the stations with status ok",
    "anchors": "rigid, without scale, on the anchors with status ok (their errors are flattered)",
    "both": "rigid, without scale, on the stations and anchors with status ok",
    "unaligned": "none asked for: places are compared as they are",
    "none": "NOT POSSIBLE: the reference knows too few places with status ok; nothing is scored",
}


def evaluation_to_json(evaluation: Evaluation) -> dict[str, Any]:
    """Dictionaries, lists, text, numbers and None only; lengths in m, angles in degrees.

    What is not known is None, so the JSON has no NaN.
    """
    pose = evaluation.reference_T_world
    frame = None
    if pose is not None:
        frame = {"x_m": pose.x, "y_m": pose.y, "yaw_deg": math.degrees(pose.theta)}
    return {
        "survey": evaluation.survey_name,
        "mode": evaluation.mode,
        "alignment": evaluation.alignment,
        "reference_T_world": frame,
        "stations": _group_to_json(evaluation.stations, headings=True),
        "anchors": _group_to_json(evaluation.anchors, headings=False),
    }


def _group_to_json(group: GroupEvaluation, *, headings: bool) -> dict[str, Any]:
    nees, dof = group.ok_nees
    values = {
        "expected": group.expected,
        "unplaced": group.unplaced,
        "without_reference": group.without_reference,
        "absent": list(group.absent),
        "not_ok": [{"id": name, "status": str(status)} for name, status in group.not_ok],
        "ok": _summary_to_json(group.ok_errors, "m", 1.0),
        "placed": _summary_to_json(group.placed_errors, "m", 1.0),
        "ok_nees": {"sum": nees if dof else None, "dof": dof},
        "items": [_item_to_json(item, headings=headings) for item in group.items],
    }
    if headings:
        values["ok_heading"] = _summary_to_json(group.ok_heading_errors, "deg", math.degrees(1.0))
    return values


def _summary_to_json(summary: ErrorSummary, unit: str, scale: float) -> dict[str, Any]:
    return {
        "count": summary.count,
        f"rmse_{unit}": _number(summary.rmse * scale),
        f"median_{unit}": _number(summary.median * scale),
        f"max_{unit}": _number(summary.max * scale),
    }


def _item_to_json(item: ItemEvaluation, *, headings: bool) -> dict[str, Any]:
    values = {
        "id": item.id,
        "status": str(item.status),
        "placed": item.placed,
        "referenced": item.referenced,
        "dx_m": _number(item.dx),
        "dy_m": _number(item.dy),
        "error_m": _number(item.error),
        "nees": _number(item.nees),
        "nees_dof": item.nees_dof,
    }
    if headings:
        values["heading_error_deg"] = _number(math.degrees(item.heading_error))
    return values


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def format_evaluation(evaluation: Evaluation) -> str:
    """Summary, and errors of what the reference knows; fixed width, `-` where a value is unknown."""
    lines = [
        f"survey {evaluation.survey_name}, mode {evaluation.mode}",
        f"alignment: {_ALIGNED_ON[evaluation.alignment]}",
        "",
        *_summary_lines(evaluation),
    ]
    for title, group in (("anchor", evaluation.anchors), ("station", evaluation.stations)):
        # What the reference does not know is counted above; a row of dashes adds nothing.
        items = [item for item in group.items if item.referenced or item.status is not Status.OK]
        if items:
            lines += ["", *_item_lines(title, items, headings=title == "station")]
    for title, group in (("anchors", evaluation.anchors), ("stations", evaluation.stations)):
        if group.absent:
            lines += [
                "",
                f"{title} of the reference that the solution lacks: {', '.join(group.absent)}",
            ]
    return "\n".join(lines)


def _summary_lines(evaluation: Evaluation) -> list[str]:
    rows = []
    for title, group in (("anchors", evaluation.anchors), ("stations", evaluation.stations)):
        nees, dof = group.ok_nees
        for label, errors in (("ok", group.ok_errors), ("all placed", group.placed_errors)):
            ratio = f"{nees / dof:.2f}" if label == "ok" and dof else "-"
            rows.append(
                [title, label, f"{errors.count} of {group.expected}", *_lengths(errors), ratio]
            )
        if group is evaluation.stations and (turn := group.ok_heading_errors).count:
            values = (turn.rmse, turn.median, turn.max)
            degrees = [f"{math.degrees(value):.2f} deg" for value in values]
            rows.append([title, "ok, heading", f"{turn.count}", *degrees, "-"])
    head = ["", "", "scored", "RMSE", "median", "max", "NEES/dof"]
    lines = _columns([head, *rows], left=2)
    for title, group in (("anchors", evaluation.anchors), ("stations", evaluation.stations)):
        if group.unplaced:
            lines.append(f"{title} without a place: {group.unplaced}")
        if group.without_reference:
            lines.append(f"{title} that the reference does not know: {group.without_reference}")
    return lines


def _item_lines(title: str, items: Sequence[ItemEvaluation], *, headings: bool) -> list[str]:
    head = [
        title,
        "status",
        "error m",
        "dx m",
        "dy m",
        "NEES",
        *(["heading deg"] if headings else []),
    ]
    rows = [
        [
            item.id,
            str(item.status) if item.placed else f"{item.status}, no place",
            _fixed(item.error, "{:.3f}"),
            _fixed(item.dx, "{:+.3f}"),
            _fixed(item.dy, "{:+.3f}"),
            _fixed(item.nees, "{:.1f}"),
            *([_fixed(math.degrees(item.heading_error), "{:+.2f}")] if headings else []),
        ]
        for item in items
    ]
    return _columns([head, *rows], left=2)


def _lengths(errors: ErrorSummary) -> list[str]:
    return [_fixed(value, "{:.3f} m") for value in (errors.rmse, errors.median, errors.max)]


def _fixed(value: float, form: str) -> str:
    return form.format(value) if math.isfinite(value) else "-"


def _columns(rows: Sequence[Sequence[str]], left: int) -> list[str]:
    """Rows of equal length as lines; the first `left` columns start flush, the others end flush."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(
            cell.ljust(width) if k < left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]
