"""Table: time to add one station to a problem of many, and how near the end is to solving at once.

    python scripts/benchmark_growing.py --stations 500 --anchors 50

Stations stand on a lattice 2.5 m apart and hear the anchors within 15 m; each is matched with the
neighbours that are there. A third of the links is long. What is timed is `add_station` alone.
"""

from __future__ import annotations

import argparse
import time

import gtsam
import numpy as np

from slam_uwb.graph import factors
from slam_uwb.graph.growing import GrowingProblem
from slam_uwb.graph.incremental import solve_by_passes
from slam_uwb.graph.variables import Indices, Variables
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement, ScanMatch
from slam_uwb.model.settings import GraphSettings, RangingSettings
from slam_uwb.model.survey import Anchor, RangeOffset, Station
from slam_uwb.ranging import link_model

SPACING_M, RADIO_M, NEIGHBOUR_M = 2.5, 15.0, 4.0
SIGMAS = np.array([0.01, 0.01, 0.003])
PRIOR = RangeOffset(0.2, 0.1)
SETTINGS = GraphSettings()


def draw(count: int, anchor_count: int, seed: int):
    """Stations, and for each its matches with earlier ones and its links; the anchors."""
    rng = np.random.default_rng(seed)
    width = int(np.ceil(np.sqrt(count)))
    poses = [
        Pose2(SPACING_M * (k % width), SPACING_M * (k // width), rng.uniform(-3, 3))
        for k in range(count)
    ]
    # The first station is the frame.
    poses = [poses[0].inverse() @ pose for pose in poses]
    places = poses[0].inverse().transform(rng.uniform(-1, SPACING_M * width + 1, (anchor_count, 2)))
    centres = np.array([pose.translation for pose in poses])
    stations = [Station(f"s{k:04d}", None, 1.4) for k in range(count)]
    anchors = [Anchor(f"A{k:03d}", 2.5) for k in range(anchor_count)]
    matches, links = [[] for _ in poses], [[] for _ in poses]
    for k, pose in enumerate(poses):
        near = np.flatnonzero(np.hypot(*(centres[:k] - centres[k]).T) < NEIGHBOUR_M)
        for j in near:
            found = poses[j].inverse() @ pose @ Pose2(*rng.normal(0.0, SIGMAS))
            ends = (stations[j].id, stations[k].id)
            matches[k].append(ScanMatch(*ends, found, np.diag(SIGMAS**2), 1.0, 0.0, 1.0, 0))
        for a, place in enumerate(places):
            away = float(np.hypot(*(place - pose.translation)))
            if away < RADIO_M:
                error = 0.2 + rng.normal(0.0, 0.08) + rng.gamma(1.3, 0.3) * (rng.random() < 0.33)
                d = float(np.hypot(away, 1.1)) + error
                links[k].append(LinkMeasurement(stations[k].id, anchors[a].id, d, d, 0.1, 10))
    return stations, matches, links, anchors


def solve_at_once(problem: GrowingProblem, stations, matches, anchors) -> Variables:
    """The batch solution of the same factors, from where the growing problem ended."""
    indices = Indices(
        {s.id: k for k, s in enumerate(stations)}, {a.id: k for k, a in enumerate(anchors)}
    )
    model = link_model(RangingSettings())
    fixed = gtsam.NonlinearFactorGraph()
    fixed.push_back(factors.gauge_factor(0, Pose2.identity()))
    fixed.push_back(factors.offset_prior(PRIOR))
    for name in problem.variables.anchors:
        fixed.push_back(factors.delay_prior(indices.anchors[name], model.anchor_sigma))
    for match in (m for each in matches for m in each):
        ends = (indices.stations[match.target], indices.stations[match.source])
        fixed.push_back(factors.match_factor(match, *ends))
    return solve_by_passes(fixed, problem.ranges, problem.variables, indices, SETTINGS).variables


def main() -> None:
    """Print times and gap."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--stations", type=int, default=500)
    parser.add_argument("--anchors", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    stations, matches, links, anchors = draw(arguments.stations, arguments.anchors, arguments.seed)
    problem = GrowingProblem(anchors, link_model(RangingSettings()), PRIOR, SETTINGS)
    seconds = []
    for each in zip(stations, matches, links, strict=True):
        start = time.perf_counter()
        problem.add_station(*each)
        seconds.append(time.perf_counter() - start)
    last = 1000.0 * np.array(seconds[-max(1, len(seconds) // 5) :])
    start = time.perf_counter()
    passes = problem.settle()
    settling = time.perf_counter() - start
    other = solve_at_once(problem, stations, matches, anchors)
    mine = problem.variables
    gaps = [pose.distance_to(other.poses[name]) for name, pose in mine.poses.items()]
    gaps += [float(np.hypot(*(p - other.anchors[n]))) for n, p in mine.anchors.items()]
    print(
        "| stations | anchors placed | links | add one, ms: median | 95 % | settle, s | gap to the whole, mm |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    print(
        f"| {len(stations)} | {len(mine.anchors)} of {len(anchors)} | {len(problem.ranges.table.measured)} "
        f"| {np.median(last):.0f} | {np.percentile(last, 95):.0f} | {settling:.1f} in {passes} passes "
        f"| {1000.0 * max(gaps):.3f} |"
    )
    print("\nTimes are of the last fifth of the stations.")


if __name__ == "__main__":
    main()
