"""decisions.csv: what a person decided about pairs of stations and links."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..model.geometry import FloatArray, Pose2
from ..model.survey import Decision
from .degrees import radians_from_degrees
from .files import FileContent
from .findings import Findings, shown
from .survey_rows import Names
from .tables import Column, Table, read_table

GUESS = ("dx_m", "dy_m", "dyaw_deg")
DECISIONS = (
    *(Column(name, number=False) for name in ("kind", "a", "b", "decision")),
    *(Column(name, required=False, may_be_empty=True) for name in GUESS),
)


def read_decisions(content: FileContent, names: Names, findings: Findings) -> tuple[Decision, ...]:
    """decisions.csv."""
    table = read_table(content, DECISIONS, findings)
    if table is None:
        return ()
    absent = np.full(len(table.lines), np.nan)
    guesses = np.column_stack([table.numbers.get(name, absent) for name in GUESS])
    decided: dict[tuple[str, ...], int] = {}
    decisions = (
        _decision(row, guesses[row], table, names, decided, findings)
        for row in range(len(table.lines))
    )
    return tuple(decision for decision in decisions if decision is not None)


def _decision(
    row: int,
    guess: FloatArray,
    table: Table,
    names: Names,
    decided: dict[tuple[str, ...], int],
    findings: Findings,
) -> Decision | None:
    line = int(table.lines[row])
    kind, a, b, verdict = (table.texts[name][row] for name in ("kind", "a", "b", "decision"))
    if kind not in ("pair", "link"):
        findings.fault(table.name, f"{shown(kind)}: expected pair or link", line, "kind")
        return None
    others: Mapping[str, str] = names.stations if kind == "pair" else names.anchors
    problems = {
        "a": f"{shown(a)}: no such station" if a not in names.stations else None,
        "b": f"{shown(b)}: no such {'station' if kind == 'pair' else 'anchor'}"
        if b not in others
        else None,
        "decision": _verdict_problem(kind, verdict),
    }
    if verdict == "guess" and kind == "pair":
        problems |= {
            name: None if np.isfinite(value) else f"{value:g}: a guess needs a finite number"
            for name, value in zip(GUESS, guess, strict=True)
        }
    if a == b and kind == "pair":
        problems["b"] = f"{shown(b)}: expected another station than a"
    for column, problem in problems.items():
        if problem is not None:
            findings.fault(table.name, problem, line, column)
    if any(problems.values()):
        return None
    target = others[b]
    key = (kind, *sorted((a, target))) if kind == "pair" else (kind, a, target)
    if key in decided:
        findings.fault(
            table.name, f"{kind} {a}, {b} was already decided in line {decided[key]}", line
        )
    decided.setdefault(key, line)
    pose = Pose2(float(guess[0]), float(guess[1]), float(radians_from_degrees(guess[2])))
    return Decision(kind, a, target, verdict, pose if verdict == "guess" else None)


def _verdict_problem(kind: str, verdict: str) -> str | None:
    allowed = ("keep", "drop", "guess") if kind == "pair" else ("keep", "drop")
    return (
        None
        if verdict in allowed
        else f"{shown(verdict)}: expected {' or '.join(allowed)} for a {kind}"
    )
