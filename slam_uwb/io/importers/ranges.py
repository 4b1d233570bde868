"""Logs of UWB tags, one station a file -> distances by anchor."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from ...model.errors import SlamUwbError
from ..files import FileContent
from ..findings import Findings
from ..survey_toml import IDENTIFIER
from ..tables import Column, read_table
from .source import fault, lines, raise_faults

Links = dict[str, list[float]]
ParseLine = Callable[[str], Sequence[tuple[str, float]] | None]
"""A line -> (anchor, m) readings; None where it is no whole report."""


def read_log(content: FileContent, parse: ParseLine) -> Links:
    """Distances of all whole reports of a text log; other lines are passed over, they are usual in logs."""
    links: Links = {}
    last = 0
    for number, line in lines(content):
        last = number
        for anchor, distance in parse(line) or ():
            links.setdefault(anchor, []).append(distance)
    if not links:
        raise fault(content, last, None, f"no whole report in {last} lines: another format?")
    return links


def read_range_csv(content: FileContent) -> Links:
    """CSV with the columns anchor and range_m."""
    findings = Findings()
    table = read_table(
        content, [Column("anchor", number=False), Column("range_m", finite=True)], findings
    )
    raise_faults(findings)
    links: Links = {}
    if table is not None:
        for line, anchor, distance in zip(
            table.lines, table.texts["anchor"], table.numbers["range_m"], strict=True
        ):
            if re.match(IDENTIFIER, anchor) is None:
                raise fault(content, int(line), "anchor", f"{anchor!r}: expected an identifier")
            links.setdefault(anchor, []).append(float(distance))
    if not links:
        raise fault(content, None, None, "no rows")
    return links


def read_heights(content: FileContent) -> dict[str, float]:
    """CSV with the columns anchor and height_m."""
    findings = Findings()
    table = read_table(
        content, [Column("anchor", number=False), Column("height_m", finite=True)], findings
    )
    raise_faults(findings)
    if table is None:
        raise SlamUwbError(f"{content.name}: no rows")
    return dict(zip(table.texts["anchor"], table.numbers["height_m"].tolist(), strict=True))
