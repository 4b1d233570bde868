"""Logs of UWB tags, one station a file -> distances by anchor."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from ...model.errors import SlamUwbError
from ..files import FileContent
from ..findings import Findings
from ..survey_toml import IDENTIFIER
from ..tables import Column, read_table
from .source import fault, lines, raise_faults

Links = dict[str, list[float]]
ParseLine = Callable[[str], tuple[str | None, Sequence[tuple[str, float]]] | None]
"""A line -> the tag (None: not named) and its (anchor, m) readings; None where it is no whole report."""


def read_log(content: FileContent, parse: ParseLine, wanted: str | None = None) -> Links:
    """Distances of one tag's whole reports in a text log; other lines are passed over, they are usual in logs.

    Args:
        content: the log.
        parse: reads a line.
        wanted: the tag, as the log names it; None for the only one that there is. A log that names none
            holds one.
    """
    by_tag: dict[str | None, Links] = {}
    last = 0
    for number, line in lines(content):
        last = number
        tag, readings = parse(line) or (None, ())
        for anchor, distance in readings:
            by_tag.setdefault(tag, {}).setdefault(anchor, []).append(distance)
    if not by_tag:
        raise fault(content, last, None, f"no whole report in {last} lines: another format?")
    return _of_one_tag(content, by_tag, wanted)


def _of_one_tag(
    content: FileContent, by_tag: Mapping[str | None, Links], wanted: str | None
) -> Links:
    """The readings of the tag on the tripod: another tag's are taken somewhere else."""
    named = sorted((tag for tag in by_tag if tag is not None), key=lambda tag: (len(tag), tag))
    if not named:
        return by_tag[None]
    if wanted is None and len(named) == 1:
        return by_tag[named[0]]
    if wanted is not None and wanted in by_tag:
        return by_tag[wanted]
    counts = ", ".join(f"{tag} ({sum(map(len, by_tag[tag].values())):,} readings)" for tag in named)
    problem = f"there is no tag {wanted}" if wanted is not None else "several tags"
    raise fault(content, None, "tag", f"{problem}: name the one on the tripod (--tag) of {counts}")


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
