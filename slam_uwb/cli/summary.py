"""What `solve` prints: what holds, what does not and why, and where the picture lies."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from ..model.solution import AnchorEstimate, Continuation, Solution, StationEstimate

    Estimates = Sequence[StationEstimate] | Sequence[AnchorEstimate]


def print_warnings(warnings: Iterable[str]) -> None:
    """One line each, to stderr."""
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)


def print_summary(
    solution: Solution, out: Path, figure: Path, report: Path, *, as_json: bool
) -> None:
    """The result of one solve, to stdout."""
    from ..report.moves import describe_moves

    summary = summarise(solution)
    if as_json:
        typer.echo(
            json.dumps(
                {**summary, "out": str(out), "figure": str(figure), "report": str(report)}, indent=2
            )
        )
        return
    for line in format_summary(summary):
        typer.echo(line)
    for line in describe_moves(solution):
        typer.echo(f"continued {line}")
    typer.echo(f"solution  {out}")
    typer.echo(f"picture   {figure}")
    typer.echo(f"report    {report}")


def summarise(solution: Solution) -> dict[str, Any]:
    """Counts of what is ok and the identifiers of what is not, by status."""
    return {
        "survey": solution.survey_name,
        "mode": solution.mode,
        "frame": solution.frame,
        "aligned": solution.alignment is not None,
        "stations": _count(solution.stations),
        "anchors": _count(solution.anchors),
        "warnings": list(solution.warnings),
        "continued": None if solution.continued is None else _moves(solution.continued),
    }


def _moves(continued: Continuation) -> dict[str, Any]:
    """What was added and how far all else moved; null is what has no place or no uncertainty."""

    def known(value: float) -> float | None:
        return round(value, 4) if math.isfinite(value) else None

    return {
        "added": [str(name) for name in continued.added],
        "seen_from": continued.seen_from,
        "moves": [
            {
                "kind": move.kind,
                "id": move.id,
                "moved_m": known(move.distance),
                "sigma_before_m": known(move.before),
                "sigma_after_m": known(move.after),
                "status_before": str(move.status_before),
                "status_after": str(move.status_after),
            }
            for move in continued.moves
        ],
    }


def format_summary(summary: dict[str, Any]) -> Iterator[str]:
    """The lines of the table."""
    frame = (
        "the site's frame" if summary["frame"] == "site" else f"frame of station {summary['frame']}"
    )
    frame = "in the frame that --align asks for" if summary["aligned"] else frame
    yield f"{summary['survey']}: {summary['mode']}, {frame}"
    for kind in ("stations", "anchors"):
        count = summary[kind]
        yield f"{kind:<10}{count['ok']} of {count['all']} ok"
        for status, names in count["not_ok"].items():
            yield f"          {status}: {', '.join(names)}"


def _count(estimates: Estimates) -> dict[str, Any]:
    not_ok: dict[str, list[str]] = {}
    for estimate in estimates:
        if estimate.status != "ok":
            not_ok.setdefault(str(estimate.status), []).append(str(estimate.id))
    ok = len(estimates) - sum(map(len, not_ok.values()))
    return {"ok": ok, "all": len(estimates), "not_ok": not_ok}
