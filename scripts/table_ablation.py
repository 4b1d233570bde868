"""Table: what each part of the joint estimate gains, from the paper's least squares to true wall counts.

    python scripts/table_ablation.py --scenes paper-office flat kolakowski-flat lias-hall --seeds 0:50

Every survey is matched once; all rows are given the same matches and ranges. A row adds what its name
says to the one above it. Recorded surveys are solved as they are; then `kolakowski-flat` keeps its
scans and matches, and the errors of its links are drawn anew, a seed a drawing, from the published
ones of the same number of walls. Anchor RMSE is over all anchors, after rigid alignment on the
stations that are `ok`; an anchor that is not placed counts with the likeliest of its alternatives.
Ratios are those of the medians.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from joint.link_models import FixedModel, LossModel, OracleModel, gaussian, one_sided
from joint.matched import Matched, match_survey
from joint.scores import Score, markdown, median_worst, score, share

from slam_uwb import Settings, Solution, read_reference, read_survey, simulate_survey
from slam_uwb.batch import map_tasks
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.survey import AnchorId, StationId
from slam_uwb.simulate import Lidar, Scene

SURVEYS = Path(__file__).resolve().parents[2] / "shared" / "surveys"
REDRAWN = "kolakowski-flat"
RECORDED = (REDRAWN, "lias-hall")
SCENES = ("paper-office", "flat", *RECORDED)
SETTINGS = Settings()
LINK_SIGMA = SETTINGS.ranging.link_sigma_m
DELAY_SIGMA = 0.05
"""m, by which the anchors' own delays differ (joint study, 2)."""
ABSENT = 1e-3
"""m, standard deviation of an offset that is not there."""
MANY_WALLS = 2
"""So many or more share their published errors, of which there are few."""


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One survey, matched, with the true number of walls on its links (those without any may miss)."""

    matched: Matched
    walls: Mapping[tuple[StationId, AnchorId], int]


# A loss that knows no walls must not be asked whether they are there, nor whether an anchor moved.
_LOSS = GraphSettings(no_offset_gain=1e9, moved_cost_gap=1e9)
_LOSS_ALONE = _LOSS.model_copy(update={"offset_mean_m": 0.0, "offset_sigma_m": ABSENT})


def sequential(case: Case) -> Solution | None:
    """The paper: poses chained, then every anchor by least squares."""
    return case.matched.solved(GraphSettings(mode="sequential"))


def plain(case: Case) -> Solution | None:
    """All of it in one problem, by least squares."""
    return case.matched.solved(_LOSS_ALONE, LossModel(gaussian, LINK_SIGMA, ABSENT))


def long_allowed(case: Case) -> Solution | None:
    """A range may be too long."""
    return case.matched.solved(_LOSS_ALONE, LossModel(one_sided, LINK_SIGMA, ABSENT))


def with_offsets(case: Case) -> Solution | None:
    """All ranges have a common offset, those of an anchor a delay."""
    return case.matched.solved(_LOSS, LossModel(one_sided, LINK_SIGMA, DELAY_SIGMA))


def without_map(case: Case) -> Solution | None:
    """The density of link errors, any number of walls in the way."""
    return case.matched.solved(SETTINGS.graph, FixedModel(LINK_SIGMA))


def with_map(case: Case) -> Solution | None:
    """The density, with the walls that the scans show."""
    find_walls = case.matched.problem.link_model.find_walls
    return case.matched.solved(SETTINGS.graph, FixedModel(LINK_SIGMA, find_walls))


def full(case: Case) -> Solution | None:
    """The method as it is: parameters of the density are estimated too."""
    return case.matched.solved(SETTINGS.graph)


def oracle(case: Case) -> Solution | None:
    """The method, told how many walls every link crosses."""
    matched = case.matched
    model = OracleModel(
        LINK_SIGMA,
        walls=case.walls,
        reference=matched.reference,
        tag_offset=matched.problem.tag_offset,
    )
    return matched.solved(SETTINGS.graph, model)


VARIANTS: Mapping[str, Callable[[Case], Solution | None]] = {
    "sequential": sequential,
    "joint, plain ranges": plain,
    "one-sided loss": long_allowed,
    "+ offsets": with_offsets,
    "density, no map": without_map,
    "+ map": with_map,
    "+ estimated parameters: joint": full,
    "oracle: true wall counts": oracle,
}
COLUMNS = (
    "variant", "RMSE, median, m", "worst, m", "of sequential", "of the oracle", "anchors placed",
    "ok", "inside 95 %", "ok but > 5 sigma",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """One survey, or one drawing of a survey's ranges."""

    scene: str | Scene
    seed: int | None
    """None solves a recorded survey as it is."""
    duration_s: float
    surveys: Path


def solve_one(task: Task) -> dict[str, Score]:
    """Scores of all variants."""
    case = make_case(task)
    return {n: score(variant(case), case.matched.reference) for n, variant in VARIANTS.items()}


def make_case(task: Task) -> Case:
    """The survey of a task, matched."""
    if isinstance(task.scene, str) and task.scene in RECORDED:
        folder = task.surveys / task.scene
        return recorded_case(_recorded(folder), folder, task.seed)
    made = simulate_survey(task.scene, task.seed, lidar=Lidar(duration=task.duration_s))
    walls = {link: count for link, (count, _) in made.link_truth.items()}
    return Case(match_survey(made.survey, made.reference, SETTINGS), walls)


@lru_cache(maxsize=1)
def _recorded(folder: Path) -> Matched:
    """A survey folder, matched once a process."""
    return match_survey(read_survey(folder), read_reference(folder / "reference"), SETTINGS)


def recorded_case(matched: Matched, folder: Path, seed: int | None) -> Case:
    """The survey, every link's error replaced by a published one of as many walls unless seed is None."""
    links_file = folder / "reference" / "links.csv"
    if not links_file.exists():
        return Case(matched, {})
    with links_file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = [(StationId(row["station"]), AnchorId(row["anchor"])) for row in rows]
    walls = {name: int(row["walls"]) for name, row in zip(names, rows, strict=True)}
    errors = {name: float(row["error_m"]) for name, row in zip(names, rows, strict=True)}
    if seed is None:
        return Case(matched, walls)
    pools: dict[int, list[float]] = {}
    for name, count in walls.items():
        pools.setdefault(min(count, MANY_WALLS), []).append(errors[name])
    rng = np.random.default_rng([9000, seed])
    links = []
    for link in matched.problem.links:
        name = (link.station, link.anchor)
        change = rng.choice(pools[min(walls[name], MANY_WALLS)]) - errors[name]
        links.append(replace(link, distance=link.distance + change, mean=link.mean + change))
    return Case(matched.with_links(links), walls)


def tables(scene: str, seeds: range, duration_s: float, surveys: Path) -> dict[str, list[Task]]:
    """Titles and tasks: a recorded survey once as it is, and with errors drawn anew where it can be."""
    drawn = [Task(scene, seed, duration_s, surveys) for seed in seeds]
    title = f"{scene}, seeds {seeds[0]} to {seeds[-1]}"
    if scene not in RECORDED:
        return {title: drawn}
    once = {f"{scene} as recorded": [Task(scene, None, duration_s, surveys)]}
    return once | ({title: drawn} if scene == REDRAWN else {})


def table(scores: list[dict[str, Score]]) -> str:
    """The Markdown table of one scene."""
    medians = {n: median_worst(s[n].rmse for s in scores)[0] for n in VARIANTS}
    first, *_, last = medians.values()
    rows = []
    for name, middle in medians.items():
        of_one = [s[name] for s in scores]
        rows.append(
            [
                name,
                f"{middle:.3f}",
                f"{median_worst(s.rmse for s in of_one)[1]:.3f}",
                f"{middle / first:.2f}",
                f"{middle / last:.2f}",
                share(sum(s.placed for s in of_one), sum(s.anchors for s in of_one)),
                share(sum(s.ok for s in of_one), sum(s.anchors for s in of_one)),
                share(sum(s.inside for s in of_one), sum(s.judged for s in of_one)),
                str(sum(s.far for s in of_one)),
            ]
        )
    return markdown(COLUMNS, rows)


def main() -> None:
    """Print a table a scene as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--seeds", default="0:50", help="first:last, the last one not included")
    parser.add_argument("--duration-s", type=float, default=60.0, help="length of a recording")
    parser.add_argument("--surveys", type=Path, default=SURVEYS, help="folder of the real surveys")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split(":"))
    for scene in arguments.scenes:
        if scene in RECORDED and not (arguments.surveys / scene).is_dir():
            print(f"\n{scene}: not found in {arguments.surveys}")
            continue
        made = tables(scene, range(first, last), arguments.duration_s, arguments.surveys)
        for title, tasks in made.items():
            scores = map_tasks(solve_one, tasks, arguments.workers)
            print(f"\n{title}\n\n{table(scores)}", flush=True)


if __name__ == "__main__":
    main()
