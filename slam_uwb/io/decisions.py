"""decisions.csv: what a person decided about pairs of stations and links."""

from __future__ import annotations

import math

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
    problems = _problems(kind, a, b, verdict, guess, names)
    for column, problem in problems.items():
        findings.fault(table.name, problem, line, column)
    if problems:
        return None
    # A radio's identifier stands for its anchor; a pair is the same pair either way round.
    target = b if kind == "pair" else names.anchors[b]
    key = (kind, *sorted((a, target))) if kind == "pair" else (kind, a, target)
    if key in decided:
        problem = f"{kind} {a}, {b} was already decided in line {decided[key]}"
        findings.fault(table.name, problem, line)
    decided.setdefault(key, line)
    pose = None
    # A row copied from matches.csv to be kept says by its pose which hypothesis is meant.
    if verdict == "guess" or (kind == "pair" and verdict == "keep" and np.isfinite(guess).all()):
        x, y, yaw = guess.tolist()
        pose = Pose2(x, y, float(radians_from_degrees(yaw)))
    return Decision(kind, a, target, verdict, pose)


def _problems(
    kind: str, a: str, b: str, verdict: str, guess: FloatArray, names: Names
) -> dict[str, str]:
    """What is wrong in which column."""
    if kind not in ("pair", "link"):
        return {"kind": f"{shown(kind)}: expected pair or link"}
    problems: dict[str, str] = {}
    if a not in names.stations:
        problems["a"] = f"{shown(a)}: no such station"
    if b not in (names.stations if kind == "pair" else names.anchors):
        problems["b"] = f"{shown(b)}: no such {'station' if kind == 'pair' else 'anchor'}"
    elif kind == "pair" and a == b:
        problems["b"] = f"{shown(b)}: expected another station than a"
    allowed = ("keep", "drop", "guess") if kind == "pair" else ("keep", "drop")
    if verdict not in allowed:
        problems["decision"] = f"{shown(verdict)}: expected {' or '.join(allowed)} for a {kind}"
    elif verdict == "guess":
        problems |= {
            name: f"{value:g}: a guess needs a finite number"
            for name, value in zip(GUESS, guess.tolist(), strict=True)
            if not math.isfinite(value)
        }
    return problems
