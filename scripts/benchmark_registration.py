"""Table: matchers side by side on the same pairs of scans, on one core, in one run.

    python scripts/benchmark_registration.py --surveys ../shared/surveys/kolakowski-flat --scenes flat --seeds 0:2

Surveys are folders with a reference, scenes those of the simulator. Overlap is the share of the
points of both scans that have a point of the other within 0.1 m at the reference poses. Right means
within 0.15 m and 4 degrees on real surveys, whose references are good to centimetres, and within
0.05 m and 1 degree in simulation. `among` counts pairs of which any hypothesis is right.

Accepted are the matches that a matcher would have used: ours those that are in use after all
stations have been placed without ranges, of the others, which have no such step, the best of every
pair. Times are processor time of prepared scans (features included); `to ICP` is the median ratio
to Open3D's three-stage ICP alone, from one start 0.2 m and 10 degrees off, on the same pair. Ours does
many pairs at once: what all pairs of a survey take so, and ICP on the same pairs, is a table of its own.
Matchers whose library is not installed are left out by name.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from slam_uwb import PRESETS, Pose2, Settings, Survey, read_reference, read_survey, simulate_survey
from slam_uwb.graph import adjust_placement
from slam_uwb.matching import REFINERS, index_scans, match_pair, match_pairs, select_matches
from slam_uwb.matching.index import ScanIndex
from slam_uwb.model.geometry import FloatArray
from slam_uwb.model.settings import MatchingSettings
from slam_uwb.model.survey import Reference
from slam_uwb.scan import prepare_scan

SETTINGS = Settings()
OURS = "correlative + point_to_line (ours)"
BANDS = ((0.1, 0.2), (0.2, 0.3), (0.3, 0.5), (0.5, 1.01))
REAL, SIMULATED = (0.15, math.radians(4.0)), (0.05, math.radians(1.0))
SCENES = "paper-office,flat,corridor,twin-rooms,oblique"
COLUMNS = (
    *("survey", "matcher", "overlap", "pairs", "best right", "among", "accepted", "wrong accepted"),
    *("ms", "p95", "to ICP"),
)
TOGETHER = ("survey", "all pairs", "ours together, ms a pair", "ICP, ms a pair", "ratio")


@dataclass(frozen=True, slots=True)
class Matcher:
    """What is done once a scan, and what once a pair (target, source): poses target_T_source, best first."""

    prepare: Callable[[ScanIndex], Any]
    match: Callable[[Any, Any], list[Pose2]]


@dataclass(frozen=True, slots=True)
class Trial:
    """One matcher on one pair."""

    survey: str
    seed: int | None
    matcher: str
    station_m: str
    station_n: str
    overlap: float
    best_right: bool
    among: bool
    accepted: bool
    wrong_accepted: bool
    milliseconds: float
    to_icp: float


def of_the_package(settings: MatchingSettings) -> Matcher:
    """An initialiser and a refiner of this package."""
    return Matcher(
        lambda scan: scan,
        lambda target, source: [m.target_T_source for m in match_pair(target, source, settings)],
    )


def installed_matchers() -> dict[str, Matcher]:
    """By name; those that are not installed are named."""
    paper = PRESETS["paper"].matching
    found = {"landmark + paper_lm (the paper)": of_the_package(paper)}
    found[OURS] = of_the_package(SETTINGS.matching)
    for name, modules, matcher in (
        ("Open3D FPFH + RANSAC + ICP", ("open3d",), Matcher(fpfh_features, fpfh_ransac)),
        ("KISS-Matcher + ICP", ("kiss_matcher", "open3d"), Matcher(lambda s: s, kiss_matcher)),
    ):
        missing = [module for module in modules if not is_installed(module)]
        if missing:
            print(f"{name}: {' and '.join(missing)} not installed\n")
        else:
            found[name] = matcher
    return found


def is_installed(module: str) -> bool:
    """Whether it loads (which then has happened before times are taken)."""
    try:
        loaded = import_module(module)
    except (ImportError, OSError):
        return False
    if module == "open3d":
        loaded.utility.set_max_threads(1)
        loaded.utility.set_verbosity_level(loaded.utility.VerbosityLevel.Error)
    return True


def extruded(scan: ScanIndex, height: float, step: float) -> FloatArray:
    """(N, 3) the scan's points in layers up to a height: what works in space finds no features in a plane."""
    layers = np.arange(0.0, height + 0.5 * step, step)
    points = scan.scan.points
    return np.column_stack([np.repeat(points, len(layers), axis=0), np.tile(layers, len(points))])


def fpfh_features(scan: ScanIndex) -> tuple[ScanIndex, Any, Any]:
    """The scan, its extruded cloud and the cloud's features."""
    import open3d

    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(extruded(scan, 2.0, 0.25))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(0.5, 30))
    search = open3d.geometry.KDTreeSearchParamHybrid(1.25, 100)
    return scan, cloud, open3d.pipelines.registration.compute_fpfh_feature(cloud, search)


def fpfh_ransac(
    target: tuple[ScanIndex, Any, Any], source: tuple[ScanIndex, Any, Any]
) -> list[Pose2]:
    """Open3D's global registration, refined by its ICP."""
    import open3d

    registration = open3d.pipelines.registration
    open3d.utility.random.seed(0)
    found = registration.registration_ransac_based_on_feature_matching(
        source[1], target[1], source[2], target[2], True, 0.3,
        registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnDistance(0.3)],
        registration.RANSACConvergenceCriteria(50_000, 0.999),
    )  # fmt: skip
    matrix = found.transformation
    start = Pose2(matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0]))
    return icp(target[0], source[0], start)


def kiss_matcher(target: ScanIndex, source: ScanIndex) -> list[Pose2]:
    """KISS-Matcher, its rotations held upright, refined by Open3D's ICP."""
    import kiss_matcher as library

    matcher = library.KISSMatcher(library.KISSMatcherConfig(0.3, use_quatro=True))
    found = matcher.estimate(extruded(source, 3.0, 0.3), extruded(target, 3.0, 0.3))
    x, y, _ = found.translation
    theta = math.atan2(found.rotation[1, 0], found.rotation[0, 0])
    return icp(target, source, Pose2(x, y, theta)) if found.valid else []


def icp(target: ScanIndex, source: ScanIndex, start: Pose2) -> list[Pose2]:
    """Open3D's three-stage ICP; nothing where it finds no match."""
    refined = REFINERS["open3d"](target, source, start.vector[None, :], SETTINGS.matching)
    return [Pose2.from_vector(pose) for pose in refined.poses[refined.converged]]


def timed(action: Callable[[], list[Pose2]]) -> tuple[list[Pose2], float]:
    """The result and the milliseconds of processor time that it took."""
    begin = time.process_time()
    result = action()
    return result, 1e3 * (time.process_time() - begin)


def chosen_surveys(
    folders: Sequence[Path], scenes: Sequence[str], seeds: range
) -> Iterator[tuple[str, int | None, Survey, Reference, tuple[float, float]]]:
    """Name, seed, survey, reference and tolerance of every survey asked for."""
    for folder in folders:
        yield folder.name, None, read_survey(folder), read_reference(folder / "reference"), REAL
    for scene in scenes:
        for seed in seeds:
            simulation = simulate_survey(scene, seed)
            yield scene, seed, simulation.survey, simulation.reference, SIMULATED


def overlap_at(target: ScanIndex, source: ScanIndex, truth: Pose2) -> float:
    """Share of the points of both scans with a point of the other within 0.1 m."""
    fixed, moved = target.scan.points, truth.transform(source.scan.points)
    near = [cKDTree(a).query(b)[0] < 0.1 for a, b in ((fixed, moved), (moved, fixed))]
    return float(np.mean([part.mean() for part in near]))


def icp_milliseconds(target: ScanIndex, source: ScanIndex, truth: Pose2) -> float:
    """Of Open3D's ICP alone; NaN where it is not installed."""
    if not is_installed("open3d"):
        return math.nan
    start = truth @ Pose2(0.2, 0.0, math.radians(10.0))
    return timed(lambda: icp(target, source, start))[1]


def placed_matches(scans: Mapping[str, ScanIndex]) -> tuple[dict[tuple[str, str], Pose2], float]:
    """Our matches in use after all stations have been placed, and milliseconds that all pairs took together."""
    pairs = list(combinations(scans, 2))
    begin = time.process_time()
    hypotheses = match_pairs(pairs, scans, SETTINGS.matching)
    took = 1e3 * (time.process_time() - begin)
    selection = select_matches(scans, hypotheses, pairs, SETTINGS.matching, adjust=adjust_placement)
    return {(match.target, match.source): match.target_T_source for match in selection.used}, took


@dataclass(frozen=True, slots=True)
class Together:
    """All pairs of one survey, those that share nothing among them."""

    survey: str
    pairs: int
    ours_ms: float
    icp_ms: float


def trials_of(
    name: str, seed: int | None, survey: Survey, reference: Reference, tolerance: tuple[float, float],
    matchers: Mapping[str, Matcher],
) -> Iterator[Trial | Together]:  # fmt: skip
    """All matchers on all pairs of a survey that overlap, and ours on all pairs at once."""
    recordings = sorted((s for s in survey.stations if s.scan), key=lambda s: s.id)
    scans = index_scans(
        {s.id: prepare_scan(s.id, s.scan, SETTINGS.scan) for s in recordings if s.scan},
        SETTINGS.matching,
    )
    places = {s: Pose2(p.x, p.y, p.theta) for s, p in reference.stations.items()}
    placed, ours_ms = placed_matches(scans)
    all_icp_ms = []
    prepared = {k: {s: m.prepare(scan) for s, scan in scans.items()} for k, m in matchers.items()}
    for m, n in combinations(scans, 2):
        truth = places[m].inverse() @ places[n]

        def right(pose: Pose2, truth: Pose2 = truth) -> bool:
            return pose.distance_to(truth) < tolerance[0] and pose.angle_to(truth) < tolerance[1]

        overlap = overlap_at(scans[m], scans[n], truth)
        icp_ms = icp_milliseconds(scans[m], scans[n], truth)
        all_icp_ms.append(icp_ms)
        if overlap < BANDS[0][0]:
            continue
        for matcher, scan in prepared.items():
            found, ms = timed(lambda: matchers[matcher].match(scan[m], scan[n]))  # noqa: B023
            used = placed.get((m, n)) if matcher == OURS else next(iter(found), None)
            yield Trial(
                name, seed, matcher, m, n, overlap,
                best_right=bool(found) and right(found[0]),
                among=any(map(right, found)),
                accepted=used is not None,
                wrong_accepted=used is not None and not right(used),
                milliseconds=ms, to_icp=ms / icp_ms,
            )  # fmt: skip
    yield Together(name, len(all_icp_ms), ours_ms, sum(all_icp_ms))


def together_rows(surveys: Sequence[Together]) -> Iterator[tuple[str, ...]]:
    """A row a name: all pairs of its surveys as the program matches them."""
    for name in dict.fromkeys(survey.survey for survey in surveys):
        own = [survey for survey in surveys if survey.survey == name]
        pairs = sum(survey.pairs for survey in own)
        ours, icp_alone = sum(s.ours_ms for s in own) / pairs, sum(s.icp_ms for s in own) / pairs
        yield name, f"{pairs}", f"{ours:.1f}", f"{icp_alone:.1f}", f"{ours / icp_alone:.1f}"


def markdown(columns: Sequence[str], rows: Iterable[tuple[str, ...]]) -> str:
    """The rows as a table."""
    lines = [tuple(columns), ("---",) * len(columns), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def table_rows(trials: Sequence[Trial]) -> Iterator[tuple[str, ...]]:
    """A row a survey, band of overlap and matcher."""
    for survey in dict.fromkeys(t.survey for t in trials):
        for low, high in BANDS:
            for matcher in dict.fromkeys(t.matcher for t in trials):
                band = [
                    t for t in trials
                    if t.survey == survey and t.matcher == matcher and low <= t.overlap < high
                ]  # fmt: skip
                if band:
                    times = [t.milliseconds for t in band]
                    yield (
                        survey, matcher, f"{low}-{high}" if high <= 1.0 else f"over {low}", f"{len(band)}",
                        f"{np.mean([t.best_right for t in band]):.2f}",
                        f"{np.mean([t.among for t in band]):.2f}",
                        f"{sum(t.accepted for t in band)}", f"{sum(t.wrong_accepted for t in band)}",
                        f"{median(times):.1f}", f"{np.percentile(times, 95):.1f}",
                        f"{median(t.to_icp for t in band):.1f}",
                    )  # fmt: skip


def main() -> None:
    """Print the table; with --out write it, and every trial, too."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--surveys", nargs="*", type=Path, default=[], help="folders")
    parser.add_argument("--scenes", default=SCENES, help=f"names, default {SCENES}; '' for none")
    parser.add_argument("--seeds", default="0:10", help="first:last, default 0:10")
    parser.add_argument("--out", type=Path, help="writes OUT.md and, with every trial, OUT.csv")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    matchers = installed_matchers()
    found: list[Trial | Together] = []
    scenes = [scene for scene in arguments.scenes.split(",") if scene]
    seeds = range(*map(int, arguments.seeds.split(":")))
    for name, seed, *survey in chosen_surveys(arguments.surveys, scenes, seeds):
        print(name, "" if seed is None else seed, file=sys.stderr, flush=True)
        found.extend(trials_of(name, seed, *survey, matchers))
    trials = [trial for trial in found if isinstance(trial, Trial)]
    surveys = [survey for survey in found if isinstance(survey, Together)]
    tables = markdown(COLUMNS, table_rows(trials)), markdown(TOGETHER, together_rows(surveys))
    table = "\n".join(tables)
    print(table, end="")
    if arguments.out:
        arguments.out.with_suffix(".md").write_text(table, encoding="utf-8")
        with arguments.out.with_suffix(".csv").open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, Trial.__slots__)
            writer.writeheader()
            writer.writerows(asdict(trial) for trial in trials)


if __name__ == "__main__":
    main()
