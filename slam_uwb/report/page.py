"""The report: one file of HTML that opens from the disk, without a network.

Names out of a survey are text, never markup: jinja2 escapes all of them, and the page forbids by its
own content policy every script and style but its own two.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..model.solution import Solution
from ..planning import suggest_stations
from .moves import describe_moves
from .page_map import PageMap, build_page_map
from .page_tables import page_tables
from .trust import judge_anchors
from .verdict import Level, judge_solution

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES = Path(__file__).parent / "templates"
_PLACES = 3
"""Suggested to be measured next."""
_SIGN = {Level.GOOD: "✓", Level.USABLE: "!", Level.AGAIN: "✗"}
_CLASS = {Level.GOOD: "fine", Level.USABLE: "warn", Level.AGAIN: "bad"}


LAYERS = (
    ("floor", "floor map", True),
    ("given", "the plan given", True),
    ("rooms", "rooms", True),
    ("walls", "walls and doors", False),
    ("stations", "stations", True),
    ("anchors", "anchors", True),
    ("ovals", "2 sigma", True),
    ("places", "where to measure next", True),
    ("others", "other places not excluded", True),
    ("rejected", "links rejected", True),
    ("free", "links in sight", False),
    ("blocked", "links through walls", False),
    ("matches", "scan matches", False),
    ("grid", "grid 1 m", False),
)
"""Name, title, and whether it is shown at first."""


def draw_report(solution: Solution) -> str:
    """The report of a solution as HTML; the same solution gives the same text.

    Args:
        solution: as solved, or read back from its folder: nothing else is needed.

    Returns:
        One page with its style, its script and the floor map inside.
    """
    from markupsafe import Markup

    anchors = judge_anchors(solution)
    verdict = judge_solution(solution, anchors)
    places = suggest_stations(solution, _PLACES, solution.settings.planning)
    page_map = build_page_map(solution, anchors, places)
    style, script = (
        (_TEMPLATES / name).read_text(encoding="utf-8") for name in ("report.css", "report.js")
    )
    return (
        _environment()
        .get_template("report.html")
        .render(
            solution=solution,
            verdict=verdict,
            sign=_SIGN[verdict.level],
            tone=_CLASS[verdict.level],
            map=page_map,
            layers=[layer for layer in LAYERS if layer[0] in _filled(page_map)],
            tables=page_tables(solution, anchors),
            places=places,
            moved=tuple(describe_moves(solution)),
            facts=tuple(solver_facts(solution)),
            changed=tuple(changed_settings(solution)),
            # The package's own files, and the only text that is not escaped.
            style=Markup(style),  # noqa: S704
            script=Markup(script),  # noqa: S704
            style_hash=_hash(style),
            script_hash=_hash(script),
        )
    )


def _filled(page_map: PageMap) -> set[str]:
    """Names of the layers that show something: a box that does nothing when it is ticked misleads."""
    contents = {
        "floor": page_map.picture,
        "given": page_map.given,
        "rooms": page_map.rooms,
        "walls": page_map.walls or page_map.doors,
        "stations": page_map.stations,
        "anchors": page_map.anchors,
        "ovals": page_map.ovals,
        "places": page_map.places,
        "others": page_map.others,
        "matches": page_map.matches,
        "grid": page_map.view,
    }
    return {name for name, content in contents.items() if content} | {
        line.kind for line in page_map.links
    }


def _environment() -> Environment:
    """Where every name is escaped, and one that the template misspells is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def solver_facts(solution: Solution) -> Iterator[tuple[str, str]]:
    """What led to the numbers, name and value."""
    frame = solution.frame
    yield "mode", solution.mode
    own = "the site's" if frame == "site" else f"that of station {frame}"
    yield "frame", own if solution.alignment is None else f"as --align asks; before, {own}"
    if solution.alignment is not None:
        moved = solution.alignment
        degrees = math.degrees(moved.theta)
        yield "moved by --align", f"x {moved.x:.3f} m, y {moved.y:.3f} m, turned by {degrees:.2f}°"
    if solution.picture is not None:
        height, width = (n * solution.picture.resolution for n in solution.picture.occupancy.shape)
        yield (
            "the plan given",
            f"{width:.2f} m wide and {height:.2f} m high, by the points marked in it",
        )
    for bias in solution.biases:
        prior = f"before: {bias.prior_mean:.3f} m ± {2.0 * bias.prior_sigma:.3f} m"
        yield bias.name, f"{bias.mean:.3f} m ± {2.0 * bias.sigma:.3f} m (2 sigma; {prior})"
    if solution.checks is not None:
        gap = f"{1000.0 * solution.checks.isam2_batch_gap:.4f} mm apart at most"
        yield "iSAM2 and batch Levenberg-Marquardt", gap
        other = solution.checks.other_starts_gap
        yield (
            "from other starts of the anchors",
            f"a better optimum {1000.0 * other:.1f} mm away"
            if other > 0.0
            else "no better optimum",
        )
        yield "passes", str(solution.checks.iterations)
        yield "cost", f"{solution.checks.cost:.2f} (half the sum of squared whitened residuals)"
    used = sum(link.rejection is None for link in solution.links)
    yield "links", f"{used} used of {len(solution.links)}"
    used = sum(match.rejection is None for match in solution.matches)
    yield "scan matches", f"{used} used of {len(solution.matches)} hypotheses"
    yield "software", f"slam-uwb {solution.software_version}"
    if solution.checksum:
        yield "survey's checksum", solution.checksum


def changed_settings(solution: Solution) -> Iterator[tuple[str, str, str]]:
    """Settings that are not the defaults: name, value, default."""
    default = type(solution.settings)().model_dump()
    for section, values in solution.settings.model_dump().items():
        for name, value in values.items():
            if value != default[section][name]:
                yield f"{section}.{name}", _shown(value), _shown(default[section][name])


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _hash(text: str) -> str:
    """Of a style or script as the page's content policy names it."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
