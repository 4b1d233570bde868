"""Table: what the joint estimate costs where nothing is wrong with the ranges, and what gross faults cost it.

    python scripts/table_robustness.py --scenes paper-office flat --seeds 0:20

First, all links in line of sight and without bias: errors by those of plain least squares in the same
graph, for radios of which nothing is known and for `calibrated` ones. Then a fifth of every anchor's
links wrong by 1.5 to 30 m, at least three left right: errors by those without the faults. Anchor RMSE
as in `table_ablation.py`; a survey is matched once.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from joint.faults import spoil_links
from joint.link_models import LossModel, gaussian
from joint.matched import match_survey
from joint.scores import Score, markdown, median_worst, score, share

from slam_uwb import Settings, Solution, simulate_survey
from slam_uwb.batch import map_tasks
from slam_uwb.model.settings import GraphSettings
from slam_uwb.simulate import Lidar, Radio, Scene

SETTINGS = Settings()
CALIBRATED = GraphSettings(radios="calibrated")
IN_SIGHT = Radio(offset=0.0, anchor_sigma=0.0, wall_delay=0.0, furniture_delay=0.0, wall_loss=0.0)
"""Walls neither delay nor weaken what passes: every link is as one in line of sight."""
FAULTY_PART = 0.2
ABSENT = 1e-3
"""m, standard deviation of an offset that is not there."""
PLAIN = GraphSettings(
    offset_mean_m=0.0, offset_sigma_m=ABSENT, no_offset_gain=1e9, moved_cost_gap=1e9
)
SIGHT_COLUMNS = (
    "all links in line of sight", "RMSE, median, m", "of least squares, median", "worst seed",
    "ok", "inside 95 %", "ok but > 5 sigma",
)  # fmt: skip
FAULT_COLUMNS = (
    "a fifth of the links wrong", "RMSE, median, m", "without, m", "median ratio",
    "ratio of pooled RMSE", "worst seed", "ok", "named", "named wrongly", "ok but > 5 sigma",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """One survey of a scene."""

    scene: str | Scene
    seed: int
    duration_s: float


@dataclass(frozen=True, slots=True)
class InSight:
    """One survey all of whose links are in line of sight, by three estimates."""

    plain: Score
    unknown: Score
    calibrated: Score


@dataclass(frozen=True, slots=True)
class Faulty:
    """One survey without and with faults."""

    clean: Score
    spoiled: Score
    faults: int
    named: int
    named_wrongly: int


def solve_in_sight(task: Task) -> InSight:
    """Least squares and the method, for radios of which nothing is known and for calibrated ones."""
    made = simulate_survey(
        task.scene, task.seed, lidar=Lidar(duration=task.duration_s), radio=IN_SIGHT
    )
    matched = match_survey(made.survey, made.reference, SETTINGS)
    least_squares = LossModel(gaussian, SETTINGS.ranging.link_sigma_m, ABSENT)
    solutions = (
        matched.solved(PLAIN, least_squares),
        matched.solved(SETTINGS.graph),
        matched.solved(CALIBRATED),
    )
    return InSight(*(score(solution, made.reference) for solution in solutions))


def solve_faulty(task: Task) -> Faulty:
    """The method without faults and with."""
    made = simulate_survey(task.scene, task.seed, lidar=Lidar(duration=task.duration_s))
    matched = match_survey(made.survey, made.reference, SETTINGS)
    rng = np.random.default_rng([500, task.seed])
    links, faults = spoil_links(matched.problem.links, FAULTY_PART, rng)
    solution = matched.with_links(links).solved(SETTINGS.graph)
    named = rejected(solution)
    return Faulty(
        clean=score(matched.solved(SETTINGS.graph), made.reference),
        spoiled=score(solution, made.reference),
        faults=len(faults),
        named=len(named & faults),
        named_wrongly=len(named - faults),
    )


def rejected(solution: Solution | None) -> set[tuple[str, str]]:
    """The links between placed ends that a solution gives a reason against."""
    return {
        (link.station, link.anchor)
        for link in (() if solution is None else solution.links)
        if link.rejection is not None and math.isfinite(link.residual)
    }


def ratios(scores: Sequence[Score], rivals: Sequence[Score]) -> list[float]:
    """RMSE of each survey by that of its rival."""
    return [mine.rmse / other.rmse for mine, other in zip(scores, rivals, strict=True)]


def counts(scores: Sequence[Score]) -> tuple[str, str, str]:
    """`ok` ones, those inside of their ellipse, those far out."""
    ok, anchors = sum(s.ok for s in scores), sum(s.anchors for s in scores)
    inside, judged = sum(s.inside for s in scores), sum(s.judged for s in scores)
    return share(ok, anchors), share(inside, judged), str(sum(s.far for s in scores))


def sight_rows(scene: str, found: Sequence[InSight]) -> list[list[str]]:
    """A row each for least squares, unknown and calibrated radios."""
    plain = [survey.plain for survey in found]
    rivals = {
        "plain least squares": plain,
        "joint": [survey.unknown for survey in found],
        "joint, calibrated": [survey.calibrated for survey in found],
    }
    rows = []
    for name, scores in rivals.items():
        middle, worst = median_worst(ratios(scores, plain))
        rmse = median_worst(s.rmse for s in scores)[0]
        cells = [f"{scene}: {name}", f"{rmse:.3f}", f"{middle:.3f}", f"{worst:.3f}"]
        rows.append([*cells, *counts(scores)])
    return rows


def fault_row(scene: str, found: Sequence[Faulty]) -> list[str]:
    """The row of a scene."""
    clean, spoiled = [survey.clean for survey in found], [survey.spoiled for survey in found]
    middle, worst = median_worst(ratios(spoiled, clean))
    ok, _, far = counts(spoiled)
    return [
        scene,
        f"{median_worst(s.rmse for s in spoiled)[0]:.3f}",
        f"{median_worst(s.rmse for s in clean)[0]:.3f}",
        f"{middle:.2f}",
        f"{pooled(spoiled) / pooled(clean):.2f}",
        f"{worst:.2f}",
        ok,
        share(sum(s.named for s in found), sum(s.faults for s in found)),
        str(sum(s.named_wrongly for s in found)),
        far,
    ]


def pooled(scores: Sequence[Score]) -> float:
    """m, root mean square over surveys."""
    return math.sqrt(float(np.nanmean([s.rmse**2 for s in scores])))


def main() -> None:
    """Print both tables as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["paper-office", "flat"])
    parser.add_argument("--seeds", default="0:20", help="first:last, the last one not included")
    parser.add_argument("--duration-s", type=float, default=60.0, help="length of a recording")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split(":"))
    sight, faults = [], []
    for scene in arguments.scenes:
        tasks = [Task(scene, seed, arguments.duration_s) for seed in range(first, last)]
        sight += sight_rows(scene, map_tasks(solve_in_sight, tasks, arguments.workers))
        faults.append(fault_row(scene, map_tasks(solve_faulty, tasks, arguments.workers)))
    print(f"seeds {first} to {last - 1}\n\n{markdown(SIGHT_COLUMNS, sight)}\n")
    print(markdown(FAULT_COLUMNS, faults))


if __name__ == "__main__":
    main()
