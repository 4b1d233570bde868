"""Solve the bundled survey with both methods and compare them with the truth (`make demo`)."""

from __future__ import annotations

import time
from pathlib import Path

from slam_uwb.evaluate import Evaluation, GroupEvaluation, evaluate_solution
from slam_uwb.io import read_reference, read_survey, write_solution
from slam_uwb.model.settings import settings_from_mapping
from slam_uwb.pipeline import solve_survey
from slam_uwb.report import draw_report, draw_solution, figure_png

REPOSITORY = Path(__file__).resolve().parents[1]
SURVEY = REPOSITORY / "datasets" / "paper-office"
METHODS = {
    "joint": "poses and anchors in one problem",
    "sequential": "poses first, then each anchor (the paper)",
}
ROW = "{:<12}{:>13}{:>13}{:>13}{:>13}{:>9}"


def main() -> None:
    """Print one row a method and where the pictures lie."""
    survey = read_survey(SURVEY)
    reference = read_reference(SURVEY / "reference")
    print(f"{survey.name}: {len(survey.stations)} stations, {len(survey.anchors)} anchors\n")
    print(ROW.format("", "stations", "their RMSE", "anchors", "their RMSE", "time"))
    pictures = []
    for mode, meaning in METHODS.items():
        start = time.monotonic()
        solution = solve_survey(survey, settings_from_mapping({"graph": {"mode": mode}}))
        out = REPOSITORY / "out" / f"{SURVEY.name}-{mode}"
        write_solution(
            solution,
            out,
            extras={
                "figure.png": figure_png(draw_solution(solution)),
                "report.html": draw_report(solution).encode(),
            },
        )
        evaluation = evaluate_solution(solution, reference)
        print(ROW.format(mode, *_columns(evaluation), f"{time.monotonic() - start:.1f} s"))
        pictures.append(f"{mode + ':':<12}{out / 'figure.png'}\n{'':<12}{meaning}")
    print("\nfloor map, stations and anchors:", *pictures, sep="\n")
    print(
        "\nreport to open in a browser:",
        REPOSITORY / "out" / f"{SURVEY.name}-joint" / "report.html",
    )
    print("\nRMSE is over what the method calls ok; what it cannot tell says why in its status.")


def _columns(evaluation: Evaluation) -> list[str]:
    return [*_group(evaluation.stations), *_group(evaluation.anchors)]


def _group(group: GroupEvaluation) -> tuple[str, str]:
    ok = len(group.items) - len(group.not_ok)
    return f"{ok} of {len(group.items)} ok", f"{group.ok_errors.rmse:.3f} m"


if __name__ == "__main__":
    main()
