"""What moved since the earlier solution that this one continues: in words, and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..model.solution import Continuation, Move, Solution, Status
from .page_cells import Cell, Row, Table, build_table, metres
from .trust import SIGMAS

_CONTRADICTS = 3.0
"""Earlier sigmas by which new measurements of the same things should not move a place."""
_EXACT_M = 0.01
"""Moves below say nothing: a station that defines the frame has no sigma."""


def describe_moves(solution: Solution) -> Iterator[str]:
    """What was added and what moved most, what found no place, and each changed status; a line each."""
    continued = solution.continued
    if continued is None:
        return
    added = f"with {', '.join(continued.added)} added" if continued.added else "without new station"
    moved = [_largest(continued, kind) for kind in ("anchor", "station")]
    seen = f", as seen from station {continued.seen_from}" if continued.seen_from else ""
    yield f"{added}: {', '.join(text for text in moved if text) or 'nothing to compare'}{seen}"
    for station in solution.stations:
        if station.id in continued.added and station.status is not Status.OK:
            yield f"{station.id} is {station.status} in the earlier map: solve without --continue"
    for move in continued.moves:
        if move.status_after is not move.status_before:
            yield f"{move.kind} {move.id}: {move.status_before} before, {move.status_after} now"


def contradicting_moves(continued: Continuation) -> Iterator[Move]:
    """Places that were `ok` and moved by more than their earlier uncertainty allows."""
    for move in continued.moves:
        if move.status_before is Status.OK and _contradicts(move):
            yield move


def move_table(solution: Solution) -> Table:
    """Every station and anchor with its move; no rows where everything was solved from scratch."""
    moves = solution.continued.moves if solution.continued else ()
    return build_table(
        "moves",
        "Moved since",
        "What the new stations changed since the earlier solution, metres. 2 sigma: half the long "
        "axis of the ellipse, before and now. Marked: moved by more than three earlier sigmas.",
        "kind|id|moved|2 sigma before|2 sigma now|status before|status now",
        [_row(move) for move in moves],
    )


def _row(move: Move) -> Row:
    moved = metres(move.distance, 3)
    return Row(
        f"{move.kind}:{move.id}",
        (
            Cell(move.kind), Cell(move.id),
            Cell(moved.text, moved.value, "bad" if _contradicts(move) else ""),
            metres(SIGMAS * move.before, 3), metres(SIGMAS * move.after, 3),
            Cell(move.status_before.value), Cell(move.status_after.value),
        ),
    )  # fmt: skip


def _contradicts(move: Move) -> bool:
    return move.distance > max(_CONTRADICTS * move.before, _EXACT_M)


def _largest(continued: Continuation, kind: str) -> str:
    moves = [m for m in continued.moves if m.kind == kind and math.isfinite(m.distance)]
    if not moves:
        return ""
    most = max(moves, key=lambda move: move.distance)
    return f"{kind}s moved by up to {most.distance:.3f} m ({most.id})"
