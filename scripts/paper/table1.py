"""Table I and what the text says of anchor errors: RMSE, maximum, middle and corner anchors."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam_uwb.evaluate import sign_flip_test

from .experiment import experiment
from .run import Claim, Run, Section, markdown_table, shown

NAMES = ("as printed", "sequential", "sequential, offset calibrated", "joint")
MIDDLE = ("A2", "A5")
"""On a stand in the middle of the row of rooms, of the scene's seven."""
OUTER = ("A3", "A6")
"""At the far walls of the outer rooms and the corridor."""
LITERATURE = (
    ("[14]", "drone, camera, 100 points"),
    ("[16]", "one new anchor in a known system"),
    ("[17]", "drone, simulated"),
    ("[18]", "LiDAR, ranging between anchors"),
)
PAPER_RMSE_M, FACTOR = 0.34, 3.0


def make(run: Run) -> Section:
    """The table over seeds."""
    results = run.each("experiment", experiment, list(run.seeds))
    medians = {n: run.interval([r[n]["rmse"] for r in results]) for n in NAMES}
    rows = [
        ["the paper, one real office", "0.34 m", "0.34 m", "about 0.55 m", "7 of 7"],
        *(_row(run, name, results) for name in NAMES),
        *([f"{ref}, {what}", "not available", "not available", "", ""] for ref, what in LITERATURE),
    ]
    head = ["", "RMSE of `ok` anchors", "RMSE of all placed", "largest error", "anchors ok"]
    paired = sign_flip_test(
        [_number(r["joint"]["rmse"]) for r in results],
        [_number(r["sequential"]["rmse"]) for r in results],
        np.random.default_rng(0),
    )
    gaps = [medians[name].value - PAPER_RMSE_M for name in NAMES[1:3]]
    text = (
        f"Medians over {len(results)} seeds with 95 % bootstrap intervals, recordings of 10 s.\n\n"
        + markdown_table(head, rows)
        + f"\nJoint against sequential on the same surveys: better on {paired.better} of {paired.count}, mean "
        f"difference {paired.mean_difference:+.2f} m, p = {paired.p_value:.2g} (sign-flip test).\n\n"
        f"The sequential method's median differs from the paper's 0.34 m by {gaps[0]:+.2f} m, with the common "
        f"offset taken out of the ranges by {gaps[1]:+.2f} m. "
        "Nothing was tuned to meet 0.34 m. The link errors are those of real links through walls (0.9 m where "
        "no direct path exists, +0.2 m in line of sight), and least squares (eq. 10) takes every one as it is; "
        "the paper's walls, its system's calibration and how its anchors were aligned are not known.\n"
    )
    return Section("Table I: anchor errors", text, _claims(run, results, medians))


def _row(run: Run, name: str, results: list[dict[str, Any]]) -> list[str]:
    errors = [r[name]["errors"] for r in results]
    largest = run.interval([max(e.values(), default=None) for e in errors])
    return [
        name,
        shown(run.interval([r[name]["rmse"] for r in results])),
        shown(run.interval([r[name]["rmse_placed"] for r in results])),
        shown(largest),
        f"{sum(map(len, errors))} of {7 * len(errors)}",
    ]


def _claims(run: Run, results: list[dict[str, Any]], medians: dict[str, Any]) -> tuple[Claim, ...]:
    def among(name: str, anchors: tuple[str, ...]) -> Any:
        values = [r[name]["errors"].get(a) for r in results for a in anchors]
        return run.interval([v for v in values if v is not None])

    low, high = PAPER_RMSE_M / FACTOR, PAPER_RMSE_M * FACTOR
    sequential, joint = medians["sequential"], medians["joint"]
    largest = run.interval([max(r["sequential"]["errors"].values(), default=None) for r in results])
    enough = not run.quick
    return (
        Claim(
            "anchor RMSE, sequential",
            "0.34 m",
            shown(sequential),
            f"factor {FACTOR:g}",
            low < sequential.value < high if enough else None,
        ),
        Claim(
            "anchor RMSE, joint",
            "0.34 m",
            shown(joint),
            "at most the paper's",
            joint.value <= PAPER_RMSE_M if enough else None,
        ),
        Claim(
            "largest error, sequential",
            "about 0.55 m",
            shown(largest),
            f"factor {FACTOR:g}",
            0.55 / FACTOR < largest.value < 0.55 * FACTOR if enough else None,
        ),
        Claim(
            "middle anchors, joint",
            "at most 0.15 cm (sic: 0.15 m)",
            shown(among("joint", MIDDLE)),
            "0.15 m, median",
            among("joint", MIDDLE).value <= 0.15 if enough else None,
        ),
        Claim(
            "middle anchors, sequential",
            "the same",
            f"{shown(among('sequential', MIDDLE))}, outer {shown(among('sequential', OUTER))}",
            "reported, not judged",
            None,
        ),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
