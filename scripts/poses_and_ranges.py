"""Table: ranges help poses that the scans leave weak, and do not harm poses that the scans make sure.

    python scripts/poses_and_ranges.py --seeds 0:10

The first survey is a hall with a corridor of bare walls, and a scanner that sees 6 m: of the stations
in the corridor only ranges tell how far along it they are. The second is an office where half of
every anchor's links are wrong by 1.5 to 30 m. Both are matched once; then the same matches are solved
without ranges and jointly. Errors are those of the places, in the solution's own frame. Beside it
stands what is found without ranges from the start, which may leave stations out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from joint.faults import spoil_links
from joint.matched import match_survey
from joint.scores import coverage, in_frame_of, markdown, share

from slam_uwb import (
    Reference,
    Settings,
    Solution,
    evaluate_solution,
    simulate_survey,
    solve_survey,
)
from slam_uwb.batch import map_tasks
from slam_uwb.model.geometry import FloatArray
from slam_uwb.model.solution import Status
from slam_uwb.simulate import Lidar, Scene

SETTINGS = Settings()
NEAR_SIGHTED = Lidar(duration=10.0, upper_duration=0.0, max_range=6.0)
FAULTY_PART = 0.5
IN_CORRIDOR = ("s07", "s08")
COLUMNS = (
    "survey, poses by", "stations placed", "ok", "RMSE, median, m", "worst station, m", "inside 95 %",
    "ok but > 5 sigma",
)  # fmt: skip


def hall_and_corridor() -> Scene:
    """A hall with one pier, and a corridor whose end is out of sight; six stations there, two here."""
    hall = _line((8, 2), (8, 0), (0, 0), (0, 6), (8, 6), (8, 4)) + _line((3, 6), (3, 4.6))
    walls = np.array(hall + _line((8, 4), (30, 4), (30, 2), (8, 2)), dtype=np.float64)
    stations = [
        (2, 1.5),
        (5, 1.8),
        (6, 4.5),
        (4.3, 4.2),
        (1.5, 4.4),
        (7.2, 3),
        (9.6, 2.9),
        (12, 3.2),
    ]
    anchors = [
        (0.1, 0.5, 2.2), (7.9, 0.2, 2.0), (0.1, 5.5, 2.4), (7.9, 5.8, 2.3), (16.0, 3.9, 2.2),
        (11.0, 2.1, 2.3),
    ]  # fmt: skip
    return Scene(
        name="hall-and-corridor",
        walls=walls,
        partitions=walls,
        stations=np.array(stations),
        anchors=np.array(anchors),
        sequence=tuple((k, k + 1) for k in range(len(stations) - 1)),
    )


def _line(*corners: tuple[float, float]) -> list[list[tuple[float, float]]]:
    return [[start, end] for start, end in pairwise(corners)]


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Stations of one estimate."""

    stations: int
    ok: int
    errors: FloatArray
    """(K,) m, of those that have a place."""
    inside: int
    """`ok` ones inside their ellipse,"""
    judged: int
    """of so many,"""
    far: int
    """and beyond five sigmas."""

    @property
    def rmse(self) -> float:
        """Root mean square of the errors, m; NaN where nothing has a place."""
        return float(np.sqrt(np.mean(self.errors**2))) if len(self.errors) else math.nan


def weak_poses(seed: int) -> dict[str, Poses]:
    """Stations in the corridor: without ranges from the start, by the same matches, jointly."""
    made = simulate_survey(hall_and_corridor(), seed, lidar=NEAR_SIGHTED)
    matched = match_survey(made.survey, made.reference, SETTINGS)
    solutions = {
        "scans alone, matched without ranges": solve_survey(made.survey, use_ranges=False),
        "scans alone, the same matches": matched.with_links(()).solved(SETTINGS.graph),
        "jointly": matched.solved(SETTINGS.graph),
    }
    return {n: judge(s, made.reference, IN_CORRIDOR) for n, s in solutions.items()}


def sure_poses(task: tuple[str | Scene, int]) -> dict[str, Poses]:
    """Stations of a scene: without ranges, jointly, and jointly with half of the links wrong."""
    made = simulate_survey(*task)
    matched = match_survey(made.survey, made.reference, SETTINGS)
    rng = np.random.default_rng([500, task[1]])
    spoiled, _ = spoil_links(matched.problem.links, FAULTY_PART, rng)
    solutions = {
        "scans alone, the same matches": matched.with_links(()).solved(SETTINGS.graph),
        "jointly": matched.solved(SETTINGS.graph),
        "jointly, half of the links wrong": matched.with_links(spoiled).solved(SETTINGS.graph),
    }
    return {n: judge(s, made.reference) for n, s in solutions.items()}


def judge(
    solution: Solution | None, reference: Reference, names: Sequence[str] | None = None
) -> Poses:
    """The stations of those names (all but that of the frame if None) of a solution."""
    if solution is None:
        return Poses(len(names or reference.stations), 0, np.empty(0), 0, 0, 0)
    truth = in_frame_of(solution, reference)
    stations = evaluate_solution(solution, truth, align="unaligned").stations
    wanted = {str(item.id) for item in stations.items if item.id != solution.frame}
    wanted &= wanted if names is None else set(names)
    items = tuple(item for item in stations.items if item.id in wanted)
    errors = np.array([item.error for item in items])
    return Poses(
        len(items),
        sum(item.status is Status.OK for item in items),
        errors[np.isfinite(errors)],
        *coverage(items),
    )


def rows(title: str, found: Sequence[dict[str, Poses]]) -> list[list[str]]:
    """A row an estimate."""
    lines = []
    for name in found[0]:
        poses = [survey[name] for survey in found]
        errors = np.concatenate([p.errors for p in poses])
        rmse = [p.rmse for p in poses if len(p.errors)]
        lines.append(
            [
                f"{title}: {name}",
                share(len(errors), sum(p.stations for p in poses)),
                share(sum(p.ok for p in poses), sum(p.stations for p in poses)),
                f"{np.median(rmse):.4f}" if rmse else "none",
                f"{errors.max():.3f}" if len(errors) else "none",
                share(sum(p.inside for p in poses), sum(p.judged for p in poses)),
                str(sum(p.far for p in poses)),
            ]
        )
    return lines


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scene", default="paper-office", help="of the sure poses")
    parser.add_argument("--seeds", default="0:10", help="first:last, the last one not included")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(*(int(part) for part in arguments.seeds.split(":")))
    weak = map_tasks(weak_poses, seeds, arguments.workers)
    sure = map_tasks(sure_poses, [(arguments.scene, seed) for seed in seeds], arguments.workers)
    print(f"seeds {seeds[0]} to {seeds[-1]}\n")
    lines = rows("corridor of bare walls, two stations", weak) + rows(arguments.scene, sure)
    print(markdown(COLUMNS, lines))


if __name__ == "__main__":
    main()
