"""The literature's set-ups as scenarios of the same survey: [16] one new anchor, [18] ranging between anchors."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from slam_uwb import simulate_survey, solve_survey
from slam_uwb.evaluate import evaluate_solution
from slam_uwb.model.survey import AnchorRangeSamples, KnownPlace
from slam_uwb.simulate import Radio, Simulation
from slam_uwb.simulate.radio import draw_device, draw_link, sample_ranges

from .experiment import METHODS, SCENE, SHORT, experiment
from .run import Run, Section, markdown_table, shown

SAMPLES = 30


def setups(seed: int) -> dict[str, Any]:
    """Errors in m of the set-ups on one survey."""
    made = simulate_survey(SCENE, seed, lidar=SHORT)
    rng = np.random.default_rng([seed, 1])
    linked = replace(made.survey, anchor_ranges=_anchor_ranges(made, rng))
    together = solve_survey(linked, METHODS["joint"])
    errors = evaluate_solution(together, made.reference).anchors.placed_errors
    new = made.survey.anchors[int(rng.integers(len(made.survey.anchors)))].id
    known = tuple(
        anchor
        if anchor.id == new
        else replace(
            anchor,
            known=KnownPlace(
                made.reference.anchors[anchor.id].x, made.reference.anchors[anchor.id].y, 0.02
            ),
        )
        for anchor in made.survey.anchors
    )
    solution = solve_survey(replace(made.survey, anchors=known), METHODS["joint"])
    items = evaluate_solution(solution, made.reference).anchors.items
    return {"[18]": errors.rmse, "[16]": next(item.error for item in items if item.id == new)}


def make(run: Run) -> Section:
    """Table beside what the others report."""
    results = run.each("setups", setups, list(run.seeds))
    plain = run.each("experiment", experiment, list(run.seeds))
    names = {
        "as it is": ("7 anchors unknown", [r["joint"]["rmse_placed"] for r in plain]),
        "[18]": ("the same, with ranging between anchors", [r["[18]"] for r in results]),
        "[16]": ("one new anchor, six known to 2 cm", [r["[16]"] for r in results]),
    }
    rows = [[name, what, shown(run.interval(errors))] for name, (what, errors) in names.items()]
    text = (
        f"Joint mode, median over {len(results)} seeds; RMSE of the placed anchors, of [16] the error of the "
        "new one. Ranges between anchors have the same link errors as those of the tag. [14] is under *More "
        "points help*. What the others report is in the paper's Table I, whose figures are not in its text: not "
        "available.\n\n" + markdown_table(["set-up", "", "error"], rows)
    )
    return Section("The literature's set-ups", text)


def _anchor_ranges(made: Simulation, rng: np.random.Generator) -> tuple[AnchorRangeSamples, ...]:
    """What the anchors measure between one another, through the same walls."""
    radio, scene = Radio(), made.scene
    devices = [draw_device(radio, rng) for _ in scene.anchors]
    heard = []
    for a, b in combinations(range(len(scene.anchors)), 2):
        link = draw_link(scene, scene.anchors[a], scene.anchors[b], devices[b], radio, rng)
        distances = sample_ranges(link, SAMPLES, radio, rng)
        if len(distances):
            heard.append(AnchorRangeSamples(scene.anchor_ids[a], scene.anchor_ids[b], distances))
    return tuple(heard)
