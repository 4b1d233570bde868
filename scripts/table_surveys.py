"""Table: are the stations of whole surveys placed, and right? Simulated scenes, with ranges and without.

    python scripts/table_surveys.py --scenes flat,oblique,paper-office --ranges without --seeds 100:120

No sequence of pairs is given. Every station of every survey counts; those of a survey that is refused
are not placed. A station is wrong if it is called `ok` and lies further than 0.3 m from where the
others have it: the frame is that in which most stations are right, so that one wrong block is counted
once. A used match is wrong beyond 0.05 m (where it is less sure: three of its standard deviations) or
1 degree.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from slam_uwb import Pose2, Solution, evaluate_solution, simulate_survey, solve_survey
from slam_uwb.batch import map_tasks
from slam_uwb.model.errors import DisconnectedSurveyError
from slam_uwb.model.solution import Status
from slam_uwb.simulate import Lidar, Simulation

COLUMNS = (
    "scene",
    "ranges",
    "stations ok",
    "wrong",
    "ambiguous",
    "surveys all ok within 0.03 m",
    "worst ok, m",
    "wrong matches used",
    "refused",
    "s, median",
)
WRONG_M = 0.3
MATCH_M, MATCH_DEG = 0.05, 1.0
SIGMAS = 3.0
CLOSE_M = 0.03


@dataclass(frozen=True, slots=True)
class Outcome:
    """One survey."""

    stations: int
    ok: int = 0
    wrong: int = 0
    ambiguous: int = 0
    worst: float = math.nan
    wrong_matches: int = 0
    matches: int = 0
    refused: bool = False
    seconds: float = math.nan


def solve_one(task: tuple[str, bool, int, float]) -> Outcome:
    """Simulate, solve and score one survey."""
    scene, ranges, seed, duration_s = task
    simulation = simulate_survey(scene, seed, lidar=Lidar(duration=duration_s))
    survey = replace(simulation.survey, sequence=None)
    start = time.perf_counter()
    try:
        solution = solve_survey(survey, use_ranges=ranges)
    except DisconnectedSurveyError:
        return Outcome(len(survey.stations), refused=True)
    seconds = time.perf_counter() - start
    stations = solution.stations
    used = [match for match in solution.matches if match.rejection is None]
    return Outcome(
        stations=len(stations),
        ok=sum(s.status is Status.OK for s in stations),
        wrong=count_wrong(solution, simulation),
        ambiguous=sum(s.status is Status.AMBIGUOUS for s in stations),
        worst=evaluate_solution(solution, simulation.reference).stations.ok_errors.max,
        wrong_matches=count_wrong_matches(solution, simulation),
        matches=len(used),
        seconds=seconds,
    )


def true_poses(simulation: Simulation) -> dict[str, Pose2]:
    """Where the stations stood."""
    return {k: Pose2(p.x, p.y, p.theta) for k, p in simulation.reference.stations.items()}


def count_wrong(solution: Solution, simulation: Simulation) -> int:
    """Stations called ok that are not where the most stations have them."""
    truth = true_poses(simulation)
    poses = {s.id: s.pose for s in solution.stations if s.pose and s.status is Status.OK}
    true = np.array([truth[name].translation for name in poses]).reshape(-1, 2)
    found = np.array([pose.translation for pose in poses.values()]).reshape(-1, 2)
    frames = [truth[name] @ pose.inverse() for name, pose in poses.items()]
    gaps = [np.hypot(*(frame.transform(found) - true).T) for frame in frames]
    return min((int((gap > WRONG_M).sum()) for gap in gaps), default=0)


def count_wrong_matches(solution: Solution, simulation: Simulation) -> int:
    """Used matches that disagree with the true relative poses."""
    truth, wrong = true_poses(simulation), 0
    for match in solution.matches:
        if match.rejection is not None:
            continue
        true = truth[match.target].inverse() @ truth[match.source]
        error = match.target_T_source.inverse() @ true
        values, axes = np.linalg.eigh(match.covariance[:2, :2])
        # What a match itself says it does not know is no error.
        off = np.abs(axes.T @ error.translation) > np.maximum(MATCH_M, SIGMAS * np.sqrt(values))
        wrong += bool(off.any()) or abs(error.theta) > math.radians(MATCH_DEG)
    return wrong


def row(scene: str, ranges: bool, outcomes: list[Outcome]) -> str:
    """One line of the Markdown table."""
    close = sum(o.ok == o.stations and o.worst <= CLOSE_M for o in outcomes)
    worst = [o.worst for o in outcomes if not math.isnan(o.worst)]
    seconds = [o.seconds for o in outcomes if not math.isnan(o.seconds)]
    cells = [
        scene,
        "with" if ranges else "without",
        f"{sum(o.ok for o in outcomes)} of {sum(o.stations for o in outcomes)}",
        str(sum(o.wrong for o in outcomes)),
        str(sum(o.ambiguous for o in outcomes)),
        f"{close} of {len(outcomes)}",
        f"{max(worst):.3f}" if worst else "none",
        f"{sum(o.wrong_matches for o in outcomes)} of {sum(o.matches for o in outcomes)}",
        str(sum(o.refused for o in outcomes)),
        f"{median(seconds):.1f}" if seconds else "none",
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scenes", default="paper-office,flat,oblique,corridor,twin-rooms")
    parser.add_argument("--ranges", choices=("with", "without", "both"), default="both")
    parser.add_argument("--seeds", default="0:20", help="first:last, the last one not included")
    parser.add_argument("--duration-s", type=float, default=60.0, help="length of a recording")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split(":"))
    ranges = {"with": (True,), "without": (False,), "both": (True, False)}[arguments.ranges]
    kinds = [(scene, used) for scene in arguments.scenes.split(",") for used in ranges]
    tasks = [(*kind, seed, arguments.duration_s) for kind in kinds for seed in range(first, last)]
    outcomes = map_tasks(solve_one, tasks, arguments.workers)
    print(f"seeds {first} to {last - 1}, {arguments.duration_s:g} s a recording\n")
    print("| " + " | ".join(COLUMNS) + " |")
    print("| " + " | ".join("---" for _ in COLUMNS) + " |")
    count = last - first
    for index, (scene, used) in enumerate(kinds):
        print(row(scene, used, outcomes[index * count : (index + 1) * count]))


if __name__ == "__main__":
    main()
