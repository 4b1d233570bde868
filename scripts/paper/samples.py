"""Fewer ranging samples suffice: anchor RMSE against samples a link."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from slam_uwb import simulate_survey, solve_survey
from slam_uwb.evaluate import evaluate_solution
from slam_uwb.report import Curve, draw_curves, figure_png
from slam_uwb.simulate import Lidar

from .experiment import METHODS, SCENE, surveyed
from .run import Claim, Run, Section, markdown_table, shown

COUNTS = (1, 3, 10, 30, 100)
MODES = {"sequential": COUNTS, "joint": (1, 100)}
"""Which counts each mode is solved with; the joint one takes seconds a solve."""
FEW, TOLERANCE = 10, 1.1


def sweep(seed: int) -> dict[str, Any]:
    """RMSE of all placed anchors by mode and number of samples."""
    made = simulate_survey(SCENE, seed, lidar=Lidar(duration=0.1, upper_duration=0.0))
    survey = surveyed(made)
    found: dict[str, Any] = {mode: {} for mode in MODES}
    for mode, counts in MODES.items():
        for count in counts:
            ranges = tuple(replace(r, distances=r.distances[:count]) for r in survey.ranges)
            solution = solve_survey(replace(survey, ranges=ranges), METHODS[mode])
            scored = evaluate_solution(solution, made.reference)
            found[mode][count] = scored.anchors.placed_errors.rmse
    return found


def make(run: Run) -> Section:
    """Figure and claim."""
    results = run.each("samples", sweep, list(run.seeds))
    medians = {
        mode: {c: run.interval([r[mode][str(c)] for r in results]) for c in counts}
        for mode, counts in MODES.items()
    }
    curves = {
        mode: Curve(
            list(found),
            *([getattr(i, part) for i in found.values()] for part in ("value", "low", "high")),
        )
        for mode, found in medians.items()
    }
    title = f"anchors against samples a link, median of {len(results)} seeds"
    labels = ("samples a link", "RMSE of placed anchors / m")
    figure = draw_curves(title, labels, curves, scales=("log", "linear"))
    run.write("samples.png", figure_png(figure))
    rows = [
        [str(c), *(shown(found[c], decimals=3) if c in found else "" for found in medians.values())]
        for c in COUNTS
    ]
    text = (
        "![samples](samples.png)\n\nTripod at known places (1 cm), no scans, the first samples of each link:\n\n"
        + markdown_table(["samples a link", *MODES], rows)
    )
    ratio = medians["sequential"][FEW].value / medians["sequential"][COUNTS[-1]].value
    claim = Claim(
        "fewer samples suffice, sequential",
        "should not negatively impact",
        f"{FEW} samples: {ratio:.3f} of the RMSE of 100",
        f"at most {TOLERANCE}",
        None if run.quick else ratio <= TOLERANCE,
    )
    return Section("Fewer samples suffice", text, (claim,))
