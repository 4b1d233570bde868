"""One word on a whole survey: good, usable, or measure again; with the reasons and what to do."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

from ..model.products import LinkMeasurement
from ..model.solution import Solution, Status
from .moves import contradicting_moves
from .trust import MEANING, AnchorJudgement, Trust

_CONFIRMED_M = 0.001
"""iSAM2 and batch optimisation agree to this."""
_ANCHORS_FOR_POSITIONING = 3
_NAMED = 6
_SWAPPED = re.compile(r"fits anchor (?P<anchor>\S+): identifiers swapped")
"""The solver's reason for a range that fits the place of another anchor."""


class Level(StrEnum):
    """The verdict's word."""

    GOOD = "good"
    USABLE = "usable"
    AGAIN = "measure again"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be."""

    text: str
    advice: str
    grave: bool = False
    """Whether it alone makes a survey one to measure again."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict with what led to it."""

    level: Level
    summary: str
    findings: tuple[Finding, ...]


_ADVICE: dict[Status, str] = {
    Status.OK: "",
    Status.AMBIGUOUS: "one more station where it tells the places apart, or survey one place",
    Status.MIRROR_AMBIGUOUS: "one more station away from the line of those that hear it",
    Status.WEAK_GEOMETRY: "stations on other sides of it; measure its height if that is missing",
    Status.UNREACHABLE: "stations nearer to it, in rooms that see it; check that it is on",
    Status.DISCONNECTED: "one more station between it and its neighbours, seeing walls of both",
}


def judge_solution(solution: Solution, anchors: Sequence[AnchorJudgement]) -> Verdict:
    """The verdict on a solution, from the judgements of its anchors."""
    findings = (
        *_anchor_findings(anchors),
        *_station_findings(solution),
        *_link_findings(solution.links),
        *_move_findings(solution),
        *_solver_findings(solution),
    )
    level = Level.USABLE if findings else Level.GOOD
    if any(finding.grave for finding in findings):
        level = Level.AGAIN
    return Verdict(level, _summary(solution, anchors), findings)


def _summary(solution: Solution, anchors: Sequence[AnchorJudgement]) -> str:
    placed = sum(station.status is Status.OK for station in solution.stations)
    text = f"{placed} of {len(solution.stations)} stations placed"
    if anchors:
        trusted = [item for item in anchors if item.trust is Trust.YES]
        text += f", {len(trusted)} of {len(anchors)} anchors can be trusted"
        if trusted:
            text += f", the least certain of them to {max(i.two_sigma for i in trusted):.2f} m"
            text += " (2 sigma)"
    return text + "."


def _anchor_findings(anchors: Sequence[AnchorJudgement]) -> Iterator[Finding]:
    usable = sum(item.trust is not Trust.NO for item in anchors)
    if usable < min(_ANCHORS_FOR_POSITIONING, len(anchors)):
        yield Finding(
            f"only {usable} of {len(anchors)} anchors have a place: positioning needs "
            f"{min(_ANCHORS_FOR_POSITIONING, len(anchors))}",
            "see below what each of them lacks",
            grave=True,
        )
    for item in anchors:
        if item.trust is Trust.YES:
            continue
        advice = _ADVICE[item.anchor.status] or "a station near it, in line of sight"
        yield Finding(f"anchor {item.anchor.id}: {'; '.join(item.why)}", advice)


def _station_findings(solution: Solution) -> Iterator[Finding]:
    lost = [station for station in solution.stations if station.status is not Status.OK]
    if 2 * len(lost) > len(solution.stations):
        yield Finding(
            f"{len(lost)} of {len(solution.stations)} stations have no trustworthy place",
            "stations closer together, each seeing walls that its neighbours see",
            grave=True,
        )
    for status in dict.fromkeys(station.status for station in lost):
        names = [str(station.id) for station in lost if station.status is status]
        which = f"station{'s' if len(names) > 1 else ''} {_named(names)}"
        yield Finding(f"{which}: {MEANING[status]}", _ADVICE[status])


def _link_findings(links: Sequence[LinkMeasurement]) -> Iterator[Finding]:
    """Ranges that were measured between placed ends and yet contradict everything else."""
    faulty = [k for k in links if k.rejection is not None and k.residual == k.residual]
    swapped = {k: other for k in faulty if (other := _SWAPPED.match(k.rejection or ""))}
    pairs = {(k.station, *sorted([str(k.anchor), other["anchor"]])) for k, other in swapped.items()}
    for station, one, two in sorted(pairs):
        yield Finding(
            f"at station {station} the ranges of anchors {one} and {two} look swapped: each fits "
            "the place of the other",
            f"check which anchor is which at {station}: exchange {one} and {two} in its rows of "
            "ranges.csv and solve again, or record it again; both ranges are left out, so the "
            "result stands without them",
        )
    wrong = [k for k in faulty if k not in swapped and (k.rejection or "").find(" m too ") >= 0]
    if wrong:
        names = [f"{link.station} to {link.anchor} ({link.residual:+.2f} m)" for link in wrong]
        say = (
            "range contradicts the rest and is"
            if len(wrong) == 1
            else "ranges contradict the rest and are"
        )
        yield Finding(
            f"{len(wrong)} {say} not used: {_named(names)}",
            "nothing, where an anchor keeps enough other links; else see that no two identifiers "
            "were exchanged there, and record the station again",
        )


def _move_findings(solution: Solution) -> Iterator[Finding]:
    for move in contradicting_moves(solution.continued) if solution.continued else ():
        yield Finding(
            f"{move.kind} {move.id} moved by {move.distance:.2f} m since the earlier solution, which "
            f"gave it {2.0 * move.before:.2f} m (2 sigma)",
            "solve without --continue: the new recording says otherwise than the earlier ones",
        )


def _solver_findings(solution: Solution) -> Iterator[Finding]:
    checks = solution.checks
    gaps = () if checks is None else (checks.isam2_batch_gap, checks.other_starts_gap)
    for gap in gaps:
        # Written so that a gap that is not a number is a finding too.
        if not gap <= _CONFIRMED_M:
            yield Finding(
                f"two ways to the solution differ by {gap:.4f} m",
                "please report the survey: its numbers may be off by as much",
                grave=not gap <= 10.0 * _CONFIRMED_M,
            )
    for warning in solution.warnings:
        yield Finding(warning, "")


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_NAMED])
    return shown if len(names) <= _NAMED else f"{shown} and {len(names) - _NAMED} more"
