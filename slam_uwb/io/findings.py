"""Faults and warnings of one folder, gathered until everything has been looked at."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field

from ..model.errors import Fault

LISTED_PER_COLUMN = 20
"""A decimal comma spoils every row of a recording; nobody reads more than these, the rest is counted."""
_SHOWN_CHARACTERS = 60


def shown(value: object) -> str:
    """A value for a message: quoted where it is text, cut where it is long, never raw control characters."""
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):
        text = json.dumps(str(value), ensure_ascii=False)
    printable = "".join(
        c if c.isprintable() else f"\\u{ord(c):04x}" for c in text[: _SHOWN_CHARACTERS + 1]
    )
    return printable if len(text) <= _SHOWN_CHARACTERS else printable[:_SHOWN_CHARACTERS] + "..."


@dataclass(slots=True)
class _List:
    faults: list[Fault] = field(default_factory=list)
    counts: Counter[tuple[str, str | None]] = field(default_factory=Counter)

    def add(self, fault: Fault) -> None:
        place = (fault.path, fault.column)
        self.counts[place] += 1
        # Faults of a whole file or of a key are each their own; only rows come by the thousand.
        if fault.column is None or self.counts[place] <= LISTED_PER_COLUMN:
            self.faults.append(fault)

    def closed(self) -> tuple[Fault, ...]:
        more = (
            Fault(path, f"{count - LISTED_PER_COLUMN} more of these", column=column)
            for (path, column), count in self.counts.items()
            if column is not None and count > LISTED_PER_COLUMN
        )
        return (*self.faults, *more)


@dataclass(slots=True)
class Findings:
    """Collects what is wrong (`fault`) and what is odd (`warn`), in the order found.

    At most `LISTED_PER_COLUMN` a column of a file are listed one by one; a last line counts the others.
    """

    _faults: _List = field(default_factory=_List)
    _warnings: _List = field(default_factory=_List)

    def fault(
        self, path: str, problem: str, line: int | None = None, column: str | None = None
    ) -> None:
        """Note what makes the folder unreadable."""
        self._faults.add(Fault(path, problem, line, column))

    def warn(
        self, path: str, problem: str, line: int | None = None, column: str | None = None
    ) -> None:
        """Note what is read, but deserves a look."""
        self._warnings.add(Fault(path, problem, line, column))

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Every fault."""
        return self._faults.closed()

    @property
    def warnings(self) -> tuple[Fault, ...]:
        """Every warning."""
        return self._warnings.closed()
