"""Fig. 6: distributions of the positioning errors with reference and with found anchors."""

from __future__ import annotations

from statistics import median
from typing import Any

from slam_uwb.report import draw_distributions, figure_png

from .experiment import experiment
from .run import Claim, Run, Section, markdown_table, shown

ANCHORS = ("reference", "joint", "sequential")
KINDS = {"static": "static tags", "walk": "moving person"}
TOLERANCE_M = 0.05


def make(run: Run) -> Section:
    """All errors of all seeds in one distribution each, and medians a seed with intervals."""
    results = run.each("experiment", experiment, list(run.seeds))

    def errors(result: dict[str, Any], kind: str, name: str) -> list[float]:
        found = result.get(f"positioning, {name}")
        return [e for e in found[kind] if e is not None] if found else []

    panels = {
        title: {f"{n} anchors": [e for r in results for e in errors(r, kind, n)] for n in ANCHORS}
        for kind, title in KINDS.items()
    }
    run.write("fig6.png", figure_png(draw_distributions(panels)))
    rows, claims = [], []
    for kind, title in KINDS.items():
        medians = {
            n: [median(errors(r, kind, n) or [float("nan")]) for r in results] for n in ANCHORS
        }
        pairs = {
            n: run.interval([a - b for a, b in zip(medians[n], medians["reference"], strict=True)])
            for n in ANCHORS[1:]
        }
        for n in ANCHORS:
            difference = shown(pairs[n], decimals=3) if n in pairs else ""
            rows.append([title, f"{n} anchors", shown(run.interval(medians[n])), difference])
        gap = pairs["joint"].value
        holds = None if run.quick else abs(gap) <= TOLERANCE_M
        claims.append(
            Claim(
                f"medians differ little, {title}, joint",
                "about 0.05 m",
                f"{gap:+.3f} m",
                f"{TOLERANCE_M} m",
                holds,
            )
        )
        claims.append(
            Claim(
                f"the same, sequential, {title}",
                "about 0.05 m",
                f"{pairs['sequential'].value:+.3f} m",
                "reported, not judged",
                None,
            )
        )
    text = (
        "![fig. 6](fig6.png)\n\nMedian error of a survey, median over seeds, and its difference from the same "
        "measurements located with the true anchors:\n\n"
        + markdown_table(["", "", "median error", "against reference anchors"], rows)
        + "\nStatic error: distance of the mean place. Trajectory error: distance to the closest point of the "
        "path, which says nothing of progress along it. The ECDF values of the paper's figure are not in its "
        "text: not available.\n"
    )
    return Section("Fig. 6: positioning errors", text, tuple(claims))
