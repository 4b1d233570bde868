"""Table: are the errors of scan matches what their covariances tell?

    python scripts/match_consistency.py paper-office:0:3 kolakowski-flat=../shared/surveys/kolakowski-flat

Always measured are drawn rooms, corridors with an end wall and endless corridors, 360 and 720
samples a scan, noise 1 and 2 cm. Arguments add simulated scenes (SCENE:first:last seed) and survey
folders with a reference (NAME=FOLDER), matched from their true poses. NEES is the squared error by
the covariance, a degree of freedom; directions with more than 0.3 m, or as much of turn 6 m away,
claim nothing and are left out. Ideal are a mean of 1 and a median of 0.79. The reference of a real
survey is taken to have 2 cm and 0.5 degrees a station. `loops` needs no reference: the
disagreement of a survey's matches along its loops, chi-square by degrees of freedom; as matches of
one scan share its errors it lies below the NEES, in simulation at 0.4 to 0.7 of it.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

import numpy as np

from slam_uwb import Pose2, Settings, Survey, read_reference, read_survey, simulate_survey
from slam_uwb.batch import map_tasks
from slam_uwb.graph import adjust_placement
from slam_uwb.matching import REFINERS, index_scans
from slam_uwb.matching.covariance import match_covariance
from slam_uwb.matching.index import ScanIndex, index_scan
from slam_uwb.matching.rematching import rematch_pairs
from slam_uwb.model.geometry import FloatArray, Matrix3
from slam_uwb.model.products import ScanMatch
from slam_uwb.model.survey import Reference, Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays

SETTINGS = Settings()
REFERENCE_SIGMA = np.array([0.02, 0.02, math.radians(0.5)])
FREE_M, LEVER_M = 0.3, 6.0
ROOMS = (
    ((0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)),
    ((0, 0), (4, 0), (4, 3), (0, 3)),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One match: what it says and what is true."""

    error: FloatArray
    """(3,) in the source's axes."""
    covariance: Matrix3
    degenerate: bool


def draw_place(kind: str, rng: np.random.Generator) -> tuple[FloatArray, list[Pose2]]:
    """Walls (W, 2, 2) and two poses."""
    headings = rng.uniform(-math.pi, math.pi, 2)
    if kind == "room":
        corners = np.array(ROOMS[rng.integers(len(ROOMS))], dtype=float)
        walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        places = rng.uniform(0.5, 2.5, (2, 2))
    else:
        width, reach = rng.uniform(1.5, 2.5), 5.0 if kind == "end wall" else 50.0
        walls = np.array([((-50, 0), (reach, 0)), ((-50, width), (reach, width))], dtype=float)
        if kind == "end wall":
            walls = np.concatenate([walls, [[[5.0, 0.0], [5.0, width]]]])
        places = rng.uniform((-1, 0.5), (1, width - 0.5), (2, 2)) + np.array([[0, 0], [2, 0]])
    return walls, [Pose2(x, y, theta) for (x, y), theta in zip(places, headings, strict=True)]


def view(
    walls: FloatArray, pose: Pose2, samples: int, noise: float, rng: np.random.Generator
) -> ScanIndex:
    """One revolution, 12 m far."""
    bearings = (np.arange(samples) + 0.5) * (2.0 * math.pi / samples) - math.pi
    ranges = cast_rays(pose.translation, bearings + pose.theta, walls)
    ranges = ranges + rng.normal(0.0, noise, samples)
    scan = Scan(bearings, np.where(ranges <= 12.0, ranges, np.nan), 12.0)
    return index_scan(prepare_scan("s", scan, SETTINGS.scan), SETTINGS.matching)


def drawn_rows(task: tuple[str, int, float, int]) -> list[Row]:
    """Matches from starts up to 0.1 m and 3 degrees off: kind of place, samples, noise in m, how many."""
    kind, samples, noise, runs = task
    rows = []
    for seed in range(runs):
        rng = np.random.default_rng([seed, samples, round(1000 * noise)])
        walls, (a, b) = draw_place(kind, rng)
        target, source = (view(walls, pose, samples, noise, rng) for pose in (a, b))
        truth = a.inverse() @ b
        start = truth @ Pose2(*rng.uniform([-0.1, -0.1, -0.05], [0.1, 0.1, 0.05]))
        refine = REFINERS["point_to_line"]
        poses = refine(target, source, start.vector[None], SETTINGS.matching).poses
        pose = Pose2.from_vector(poses[0])
        covariance, degenerate = match_covariance(target, source, pose, SETTINGS.matching)
        rows.append(Row((truth.inverse() @ pose).vector, covariance, degenerate))
    return rows


def survey_rows(survey: Survey, reference: Reference, sigma: FloatArray) -> tuple[list[Row], float]:
    """Matches of all overlapping pairs from their true poses, and the disagreement along loops."""
    scans = {s.id: prepare_scan(s.id, s.scan, SETTINGS.scan) for s in survey.stations if s.scan}
    indexed = index_scans(scans, SETTINGS.matching)
    truth = {
        name: Pose2(place.x, place.y, place.theta)
        for name, place in reference.stations.items()
        if name in indexed
    }
    pairs = list(combinations(indexed, 2))
    matches = rematch_pairs(indexed, truth, pairs, SETTINGS.matching)
    rows = []
    for match in matches:
        error = truth[match.target].inverse() @ truth[match.source]
        error = error.inverse() @ match.target_T_source
        covariance = match.covariance + np.diag(2.0 * sigma**2)
        rows.append(Row(error.vector, covariance, match.degenerate))
    return rows, loop_disagreement(truth, matches)


def loop_disagreement(truth: dict[str, Pose2], matches: Sequence[ScanMatch]) -> float:
    """Chi-square by degrees of freedom of all matches at the poses where they agree best."""
    poses = adjust_placement(truth, matches)
    total = 0.0
    for match in matches:
        placed = poses[match.target].inverse() @ poses[match.source]
        error = (placed.inverse() @ match.target_T_source).vector
        total += float(error @ np.linalg.solve(match.covariance, error))
    stations = {name for match in matches for name in (match.target, match.source)}
    return total / max(1, 3 * (len(matches) - len(stations) + 1))


def line(name: str, rows: Sequence[Row], loops: Sequence[float]) -> str:
    """One line of the table."""
    units = np.diag([1.0, 1.0, LEVER_M])
    sums, counts = [], []
    for row in rows:
        variances, axes = np.linalg.eigh(units @ row.covariance @ units)
        held = variances < FREE_M**2
        along = (axes.T @ units @ row.error)[held]
        sums.append(float(np.sum(along**2 / variances[held])))
        counts.append(int(held.sum()))
    each = np.array(sums) / np.maximum(counts, 1)
    sigma = np.median([np.sqrt(np.diag(row.covariance)) for row in rows], axis=0)
    free = np.mean([row.degenerate for row in rows])
    return (
        f"| {name} | {len(rows)} | {sum(sums) / sum(counts):.2f} | {np.median(each):.2f} | "
        f"{np.quantile(each, 0.95):.1f} | {free:.2f} | {1e3 * max(sigma[:2]):.1f} | "
        f"{math.degrees(sigma[2]):.3f} | {f'{np.mean(loops):.2f}' if loops else '-'} |"
    )


def simulated_rows(task: tuple[str, int]) -> tuple[list[Row], float]:
    """As `survey_rows`, of a scene and a seed."""
    made = simulate_survey(*task)
    return survey_rows(made.survey, made.reference, np.zeros(3))


def asked_for(argument: str, workers: int) -> tuple[str, list[Row], list[float]]:
    """Name, matches and disagreements of one argument."""
    if "=" in argument:
        name, folder = argument.split("=", 1)
        reference = read_reference(Path(folder) / "reference")
        rows, loops = survey_rows(read_survey(Path(folder)), reference, REFERENCE_SIGMA)
        return name, rows, [loops]
    scene, first, last = argument.split(":")
    tasks = [(scene, seed) for seed in range(int(first), int(last))]
    found = map_tasks(simulated_rows, tasks, workers)
    return argument, [row for rows, _ in found for row in rows], [loops for _, loops in found]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surveys", nargs="*", help="SCENE:first:last or NAME=FOLDER")
    parser.add_argument("--runs", type=int, default=100, help="matches a line of the drawn places")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    begin = time.perf_counter()
    print(
        "| | matches | NEES mean | median | p95 | degenerate | sigma, mm | sigma, deg | loops |\n"
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    )
    tasks = list(
        product(("room", "end wall", "corridor"), (360, 720), (0.01, 0.02), [arguments.runs])
    )
    drawn = map_tasks(drawn_rows, tasks, arguments.workers)
    for (kind, samples, noise, _), rows in zip(tasks, drawn, strict=True):
        print(line(f"{kind}, {samples} points, {100 * noise:.0f} cm", rows, []), flush=True)
    for argument in arguments.surveys:
        print(line(*asked_for(argument, arguments.workers)), flush=True)
    print(f"\n{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
