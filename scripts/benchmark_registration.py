"""Benchmark: matchers side by side on the same pairs of scans, in one run.

    python scripts/benchmark_registration.py kolakowski-flat=../shared/surveys/kolakowski-flat paper-office:0:3

Arguments are survey folders with a reference (NAME=FOLDER) and simulated scenes (SCENE:first:last
seed). Overlap is the share of the points of both scans that have a point of the other within 0.1 m
at the reference pose. Right means within 0.15 m and 4 degrees on real data, 0.05 m and 1 degree on
simulated. A wrong best hypothesis counts as accepted where its evidence is that of a match
(`settings.matching.min_evidence_m`). Times are of prepared scans, on one core; the ratio is to
Open3D's three-stage ICP alone, from one start 0.2 m and 10 degrees off, on the same pair.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from statistics import median, quantiles

import numpy as np
from scipy.spatial import cKDTree

from slam_uwb import PRESETS, Pose2, Settings, Survey, read_reference, read_survey, simulate_survey
from slam_uwb.matching import REFINERS, index_scans, match_pair
from slam_uwb.matching.index import ScanIndex
from slam_uwb.model.settings import MatchingSettings
from slam_uwb.model.survey import Reference
from slam_uwb.scan import prepare_scan

BANDS = ((0.1, 0.2), (0.2, 0.3), (0.3, 0.5), (0.5, 1.0))
REAL, SIMULATED = (0.15, math.radians(4.0)), (0.05, math.radians(1.0))
Matcher = Callable[[ScanIndex, ScanIndex], list[Pose2]]


@dataclass(frozen=True, slots=True)
class Trial:
    """One matcher on one pair."""

    overlap: float
    best_right: bool
    among: bool
    accepted: bool
    milliseconds: float
    ratio: float


def ours(settings: MatchingSettings) -> Matcher:
    """A matcher of this package."""
    return lambda target, source: [
        match.target_T_source for match in match_pair(target, source, settings)
    ]


def matchers() -> dict[str, Matcher]:
    """Those that are installed, by name."""
    return {
        "landmark + paper_lm (the paper)": ours(PRESETS["paper"].matching),
        "correlative + point_to_line": ours(Settings().matching),
        "Open3D FPFH + RANSAC + ICP, extruded": fpfh_ransac,
    }


def fpfh_ransac(target: ScanIndex, source: ScanIndex) -> list[Pose2]:
    """Open3D's global registration on scans extruded to 2 m, in layers 0.25 m apart."""
    import open3d

    registration = open3d.pipelines.registration
    open3d.utility.random.seed(0)
    clouds, features = [], []
    for scan in (source, target):
        layers = np.arange(0.0, 2.01, 0.25)
        flat = np.repeat(scan.scan.points, len(layers), axis=0)
        cloud = open3d.geometry.PointCloud()
        heights = np.tile(layers, len(scan.scan.points))
        cloud.points = open3d.utility.Vector3dVector(np.column_stack([flat, heights]))
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(0.5, 30))
        search = open3d.geometry.KDTreeSearchParamHybrid(1.25, 100)
        clouds.append(cloud)
        features.append(registration.compute_fpfh_feature(cloud, search))
    found = registration.registration_ransac_based_on_feature_matching(
        *clouds, *features, True, 0.3, registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnDistance(0.3)],
        registration.RANSACConvergenceCriteria(50_000, 0.999),
    )  # fmt: skip
    matrix = found.transformation
    start = np.array([[matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])]])
    poses, converged = REFINERS["open3d"](target, source, start, Settings().matching)
    return [Pose2.from_vector(poses[0])] if converged[0] else []


def surveys(arguments: list[str]) -> Iterator[tuple[str, Survey, Reference, tuple[float, float]]]:
    """Name, survey, reference and tolerance of every survey asked for."""
    for argument in arguments:
        if "=" in argument:
            name, folder = argument.split("=", 1)
            yield name, read_survey(Path(folder)), read_reference(Path(folder) / "reference"), REAL
            continue
        scene, first, last = argument.split(":")
        for seed in range(int(first), int(last)):
            simulation = simulate_survey(scene, seed)
            yield scene, simulation.survey, simulation.reference, SIMULATED


def overlap(target: ScanIndex, source: ScanIndex, truth: Pose2) -> float:
    """Share of the points of both scans with a point of the other within 0.1 m."""
    fixed, moved = target.scan.points, truth.transform(source.scan.points)
    near = [cKDTree(a).query(b)[0] < 0.1 for a, b in ((fixed, moved), (moved, fixed))]
    return float(np.mean([part.mean() for part in near]))


def icp_milliseconds(target: ScanIndex, source: ScanIndex, truth: Pose2) -> float:
    """Open3D's ICP alone, from one start 0.2 m and 10 degrees off."""
    start = (truth @ Pose2(0.2, 0.0, math.radians(10.0))).vector[None, :]
    begin = time.perf_counter()
    REFINERS["open3d"](target, source, start, Settings().matching)
    return 1e3 * (time.perf_counter() - begin)


def run(arguments: list[str]) -> dict[tuple[str, str], list[Trial]]:
    """Trials by survey and matcher."""
    trials: dict[tuple[str, str], list[Trial]] = {}
    for name, survey, reference, (metres, radians) in surveys(arguments):
        scans = {
            s.id: prepare_scan(s.id, s.scan, Settings().scan) for s in survey.stations if s.scan
        }
        indexed = index_scans(scans, Settings().matching)
        places = {k: Pose2(p.x, p.y, p.theta) for k, p in reference.stations.items()}
        for m, n in combinations(indexed, 2):
            truth = places[m].inverse() @ places[n]
            shared = overlap(indexed[m], indexed[n], truth)
            if shared < BANDS[0][0]:
                continue
            icp = icp_milliseconds(indexed[m], indexed[n], truth)
            for matcher, match in matchers().items():
                begin = time.perf_counter()
                found = match(indexed[m], indexed[n])
                spent = 1e3 * (time.perf_counter() - begin)
                right = [
                    p.distance_to(truth) < metres and p.angle_to(truth) < radians for p in found
                ]
                best = bool(right) and right[0]
                trial = Trial(
                    shared, best, any(right), bool(found) and not best, spent, spent / icp
                )
                trials.setdefault((name, matcher), []).append(trial)
    return trials


def main() -> None:
    """Print one Markdown row a survey, matcher and band of overlap."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("surveys", nargs="+", metavar="NAME=FOLDER|SCENE:FIRST:LAST")
    trials = run(parser.parse_args().surveys)
    columns = (
        "survey",
        "matcher",
        "overlap",
        "pairs",
        "best right",
        "among",
        "wrong best",
        "ms",
        "p95",
        "to ICP",
    )
    print("| " + " | ".join(columns) + " |\n|" + " --- |" * len(columns))
    for (survey, matcher), rows in trials.items():
        for low, high in BANDS:
            band = [row for row in rows if low <= row.overlap < high]
            if not band:
                continue
            times = [row.milliseconds for row in band]
            cells = (
                survey, matcher, f"{low:g}-{high:g}", len(band),
                f"{np.mean([r.best_right for r in band]):.2f}", f"{np.mean([r.among for r in band]):.2f}",
                sum(r.accepted for r in band), f"{median(times):.1f}",
                f"{quantiles(times, n=20)[-1] if len(times) > 1 else times[0]:.1f}",
                f"{median(r.ratio for r in band):.1f}",
            )  # fmt: skip
            print("| " + " | ".join(map(str, cells)) + " |")


if __name__ == "__main__":
    main()
