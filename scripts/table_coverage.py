"""Table: how many of the stations and anchors called `ok` are inside their stated 95 % ellipse.

    python scripts/table_coverage.py --scenes paper-office flat --surveys 200

Simulated surveys, each scene in turn. Errors are taken in the solution's own frame: the truth is
brought to it by the station that the frame is tied to, which is left out, and by nothing else, so no
fit makes the errors smaller. Counted too are those `ok` that are off by more than five stated sigmas.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

from joint.scores import coverage, in_frame_of, markdown, share

from slam_uwb import Reference, Solution, evaluate_solution, simulate_survey, solve_survey
from slam_uwb.batch import map_tasks
from slam_uwb.evaluate import GroupEvaluation
from slam_uwb.simulate import Lidar, Scene

LIMITS = (0.90, 0.98)
COLUMNS = (
    "scene", "surveys", "anchors ok", "inside 95 %", "> 5 sigma", "stations ok", "inside 95 %", "> 5 sigma",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """One survey of a scene."""

    scene: str | Scene
    seed: int
    duration_s: float


@dataclass(frozen=True, slots=True)
class Counts:
    """Of the anchors, or of the stations, of some surveys."""

    items: int
    ok: int
    inside: int
    judged: int
    """`ok` ones with an ellipse."""
    far: int

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.items + other.items, self.ok + other.ok, self.inside + other.inside,
            self.judged + other.judged, self.far + other.far,
        )  # fmt: skip


def solve_one(task: Task) -> tuple[Counts, Counts]:
    """Anchors and stations of one survey."""
    made = simulate_survey(task.scene, task.seed, lidar=Lidar(duration=task.duration_s))
    return own_coverage(solve_survey(made.survey), made.reference)


def own_coverage(solution: Solution, reference: Reference) -> tuple[Counts, Counts]:
    """Anchors and stations, in the frame of the solution's gauge station."""
    truth = in_frame_of(solution, reference)
    evaluation = evaluate_solution(solution, truth, align="unaligned")
    free = tuple(item for item in evaluation.stations.items if item.id != solution.frame)
    return count(evaluation.anchors), count(replace(evaluation.stations, items=free))


def count(group: GroupEvaluation) -> Counts:
    """Of one survey."""
    inside, judged, far = coverage(group.items)
    return Counts(len(group.items), len(group.items) - len(group.not_ok), inside, judged, far)


def row(name: str, found: Sequence[tuple[Counts, Counts]]) -> list[str]:
    """One line of the table."""
    cells = [name, str(len(found))]
    for kind in zip(*found, strict=True):
        total = sum(kind, Counts(0, 0, 0, 0, 0))
        cells += [
            share(total.ok, total.items),
            share(total.inside, total.judged),
            str(total.far),
        ]
    return cells


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["paper-office", "flat"])
    parser.add_argument("--surveys", type=int, default=200, help="in all")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--duration-s", type=float, default=60.0, help="length of a recording")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    scenes = arguments.scenes
    tasks = [
        Task(scenes[k % len(scenes)], arguments.first_seed + k // len(scenes), arguments.duration_s)
        for k in range(arguments.surveys)
    ]
    found = map_tasks(solve_one, tasks, arguments.workers)
    rows = [row(scene, found[k :: len(scenes)]) for k, scene in enumerate(scenes)]
    print(markdown(COLUMNS, [*rows, row("all", found)]))
    print(f"\nseeds from {arguments.first_seed}; to be inside: {LIMITS[0]:.0%} to {LIMITS[1]:.0%}")


if __name__ == "__main__":
    main()
