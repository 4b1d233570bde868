"""Do the places that `slam-uwb plan` suggests help more than places at random? On simulated surveys.

    python scripts/planning_gain.py --first 500 --seeds 50

Each survey is the first six stations of a simulated site (four kinds in turn). Two stations are added
once where the planner says, once at two random places of the known free space, and everything is
solved again. Two figures are compared: the RMSE of the anchors that both surveys place, and that of
all anchors, where one without a sure place counts with the root mean square over its places (at
most 3 m, as one that has none).
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from slam_uwb import Solution, evaluate_solution, simulate_survey, solve_survey
from slam_uwb.model.geometry import FloatArray, Points
from slam_uwb.model.survey import Reference
from slam_uwb.planning import suggest_stations
from slam_uwb.planning.views import free_places
from slam_uwb.simulate import Lidar
from slam_uwb.simulate.catalogue import build_scene
from slam_uwb.simulate.scene import Scene
from slam_uwb.simulate.streams import Stream, stream

SCENES = ("paper-office", "flat", "oblique", "corridor")
STATIONS = 6
LOST_M = 3.0


def first_six(seed: int) -> Scene:
    """A site of which six stations have been visited."""
    scene = build_scene(SCENES[seed % len(SCENES)], stream(seed, Stream.SCENE))
    sequence = tuple(pair for pair in scene.sequence if max(pair) < STATIONS)
    return replace(scene, stations=scene.stations[:STATIONS], sequence=sequence)


def solve(scene: Scene, seed: int) -> tuple[Solution, Reference]:
    """Survey and solve; the stations before keep their recordings whatever is added."""
    lidar = Lidar(duration=20.0, upper_duration=0.0)
    simulation = simulate_survey(scene, seed, lidar=lidar, sequence=False)
    return solve_survey(simulation.survey), simulation.reference


def with_places(scene: Scene, places: Points) -> Scene:
    """The site with further stations."""
    added = range(len(scene.stations), len(scene.stations) + len(places))
    return replace(
        scene,
        stations=np.vstack([scene.stations, places]),
        sequence=scene.sequence + tuple((0, n) for n in added),
    )


def anchor_errors(solution: Solution, reference: Reference) -> tuple[FloatArray, FloatArray]:
    """(A,) m of the anchors with a place (NaN without), and of all, whatever is known of them."""
    evaluation = evaluate_solution(solution, reference)
    site_T_world = evaluation.reference_T_world
    placed = np.array([i.error if i.placed else math.nan for i in evaluation.anchors.items])
    expected = []
    for anchor in solution.anchors:
        places = [np.array([other.x, other.y]) for other in anchor.alternatives]
        shares = [other.weight for other in anchor.alternatives]
        if anchor.position is not None:
            places.append(np.asarray(anchor.position))
            shares.append(max(1.0 - sum(shares), 1e-3))
        if not places or site_T_world is None:
            expected.append(LOST_M)
            continue
        truth = reference.anchors[anchor.id]
        away = site_T_world.transform(np.array(places)) - [truth.x, truth.y]
        square = np.average((away**2).sum(axis=1), weights=shares)
        expected.append(min(math.sqrt(float(square)), LOST_M))
    return placed, np.array(expected)


def compare(seed: int) -> tuple[FloatArray, FloatArray] | None:
    """RMSE (2,) m by the planner and (2,) m at random: of the anchors that both place, and of all."""
    scene = first_six(seed)
    solution, reference = solve(scene, seed)
    site_T_world = evaluate_solution(solution, reference).reference_T_world
    suggested = suggest_stations(solution, 2, solution.settings.planning)
    if solution.floor_map is None or site_T_world is None or len(suggested) < 2:
        return None
    free = free_places(solution.floor_map, 0.1, solution.settings.planning.clearance_m)
    chance = free[np.random.default_rng([seed, 77]).choice(len(free), 2, replace=False)]
    errors = [
        anchor_errors(*solve(with_places(scene, site_T_world.transform(places)), seed))
        for places in (np.array([item.place for item in suggested]), chance)
    ]
    both = np.isfinite(errors[0][0]) & np.isfinite(errors[1][0])
    ours, others = (
        np.sqrt([np.mean(placed[both] ** 2), np.mean(expected**2)]) for placed, expected in errors
    )
    return ours, others


def main() -> None:
    """Print each survey and the share of them that the planner's places are better for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=50)
    arguments = parser.parse_args()
    wins: list[FloatArray] = []
    rows: list[FloatArray] = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        result = compare(seed)
        if result is None:
            print(f"{seed}: no two places to suggest")
            wins.append(np.zeros(2))
            continue
        ours, others = result
        wins.append(ours < others)
        rows.append(np.concatenate([ours, others]))
        print(
            f"{seed} {SCENES[seed % len(SCENES)]:<13} placed by both: {ours[0]:.2f} m, random {others[0]:.2f} m; "
            f"all: {ours[1]:.2f} m, random {others[1]:.2f} m",
            flush=True,
        )
    share = 100.0 * np.mean(wins, axis=0)
    median = np.median(rows, axis=0)
    print(f"better for the anchors that both place: {share[0]:.0f} % of {len(wins)} surveys")
    print(f"better for all anchors: {share[1]:.0f} %")
    print("median RMSE in m, planned and random: " + f"{median[0]:.3f}, {median[2]:.3f} (placed by both); "
          f"{median[1]:.3f}, {median[3]:.3f} (all)")  # fmt: skip


if __name__ == "__main__":
    main()
