"""More measurement points help: 18 against 100, as in [14]."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from slam_uwb import simulate_survey, solve_survey
from slam_uwb.evaluate import evaluate_solution, sign_flip_test
from slam_uwb.simulate import Lidar, simulate_static_tags

from .experiment import METHODS, SCENE, surveyed
from .run import Claim, Run, Section, markdown_table, shown

POINTS = 100
MODES = ("sequential", "joint")
QUIET = Lidar(duration=0.1, upper_duration=0.0)


def both(seed: int) -> dict[str, Any]:
    """RMSE of all placed anchors by mode, with the tripod's 18 places and with 100 spread over the rooms."""
    few = simulate_survey(SCENE, seed, lidar=QUIET)
    spread = simulate_static_tags(few.scene, seed, places=POINTS).truth.places
    chain = tuple((k, k + 1) for k in range(POINTS - 1))
    scene = replace(few.scene, stations=np.array(list(spread.values())), sequence=chain)
    many = simulate_survey(scene, seed, lidar=QUIET)
    found: dict[str, Any] = {}
    for name, made in (("18", few), ("100", many)):
        for mode in MODES:
            solution = solve_survey(surveyed(made), METHODS[mode])
            scored = evaluate_solution(solution, made.reference)
            found[f"{mode}, {name}"] = scored.anchors.placed_errors.rmse
    return found


def make(run: Run) -> Section:
    """Table and claims."""
    results = run.each("points", both, list(run.seeds))
    rows, claims = [], []
    for mode in MODES:
        few, many = ([r[f"{mode}, {n}"] for r in results] for n in ("18", "100"))
        paired = sign_flip_test(
            np.array(many, float), np.array(few, float), np.random.default_rng(0)
        )
        rows.append(
            [mode, shown(run.interval(few)), shown(run.interval(many)), f"{paired.p_value:.2g}"]
        )
        gain = run.interval(few).value - run.interval(many).value
        claims.append(
            Claim(
                f"more points help, {mode}",
                "18 vs 100 in [14]",
                f"{gain:+.3f} m better",
                "better" if mode == "joint" else "reported, not judged",
                None if run.quick or mode != "joint" else gain > 0.0,
            )
        )
    text = (
        "Known places (1 cm), no scans; the 100 points are spread over all rooms as a drone's would be. Errors of "
        "links behind walls are always long: for least squares more of them do not average out.\n\n"
        + markdown_table(
            ["RMSE of placed anchors", "18 points", "100 points", "p, sign-flip"], rows
        )
    )
    return Section("More points help", text, tuple(claims))
