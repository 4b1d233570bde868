"""Each stage by itself, what it can be compared with in the same run, and the whole of it."""

from __future__ import annotations

import cProfile
import gzip
import io
import pstats
import sys
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import pytest
from measure import run_measured
from scipy.spatial import KDTree
from stages import MEASURED, SETTINGS, STAGES, Site

from slam_uwb.graph import factors
from slam_uwb.pipeline import solve_survey

PROGRAM = str(Path(sys.executable).with_name("slam-uwb"))
SMALL = 18
ICP_PAIRS = 60
"""Pairs that Open3D is timed on."""
ICP_GATE_M = 0.5
OFF = np.array([0.1, -0.1])


def rounds(size: int) -> int:
    """Large ones are measured once."""
    return 3 if size <= SMALL else 1


def noted(benchmark: Any, site: Site, size: int, **more: object) -> None:
    """What the page needs to know beside the times."""
    benchmark.extra_info.update(size=size, stations=site.stations, **more)


@pytest.mark.parametrize("stage", MEASURED)
def bench_stage(benchmark: Any, site: Site, size: int, stage: str) -> None:
    if stage == "report":
        site.need("solution")
    for before in MEASURED[: MEASURED.index(stage)]:
        site.need(before)
    result = benchmark.pedantic(STAGES[stage], args=(site,), rounds=rounds(size))
    site.made[stage] = result
    more = {"pairs": len(result[2])} if stage == "pair matching" else {}
    noted(benchmark, site, size, stage=stage, **more)


def bench_numpy_reads_the_same_bytes(benchmark: Any, site: Site, size: int) -> None:
    def read() -> None:
        for path in (site.folder / "scans").iterdir():
            # Empty is no return; loadtxt knows numbers only.
            raw = path.read_bytes()
            text = gzip.decompress(raw) if path.suffix == ".gz" else raw
            data = text.replace(b",\n", b",nan\n")
            np.loadtxt(io.BytesIO(data), delimiter=",", skiprows=1)

    benchmark.pedantic(read, rounds=rounds(size))
    noted(benchmark, site, size, reference="reading", what="numpy.loadtxt of the scans")


def bench_kd_tree_alone(benchmark: Any, site: Site, size: int) -> None:
    scans = site.need("scan preparation")
    pairs = site.need("pair matching")[2]

    def query() -> None:
        for target, source in pairs:
            KDTree(scans[target].points).query(scans[source].points)

    benchmark.pedantic(query, rounds=rounds(size))
    noted(
        benchmark, site, size, reference="pair matching", what="one KD-tree and one query a pair",
    )  # fmt: skip


def bench_open3d_alone(benchmark: Any, site: Site, size: int) -> None:
    o3d = pytest.importorskip("open3d")
    scans = site.need("scan preparation")
    placement, pairs = site.need("consistency").placement, site.need("pair matching")[2]
    chosen = [(m, n) for m, n in pairs if m in placement and n in placement][:ICP_PAIRS]
    clouds = {}
    for name in {name for pair in chosen for name in pair}:
        points = np.column_stack([scans[name].points, np.zeros(len(scans[name].points))])
        clouds[name] = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))

    def refine() -> None:
        for m, n in chosen:
            start = np.eye(4)
            pose = placement[m].inverse() @ placement[n]
            start[:2, :2], start[:2, 3] = pose.rotation, pose.translation + OFF
            o3d.pipelines.registration.registration_icp(clouds[n], clouds[m], ICP_GATE_M, start)

    benchmark.pedantic(refine, rounds=rounds(size))
    noted(
        benchmark, site, size, reference="pair matching", share=len(chosen) / max(1, len(pairs)),
        what="Open3D's ICP, one start a pair",
    )  # fmt: skip


def bench_gtsam_batch_alone(benchmark: Any, site: Site, size: int) -> None:
    estimate, selection = site.need("joint solve"), site.need("consistency")
    stations = {s.id: k for k, s in enumerate(estimate.stations)}
    placed = {a.id: (k, a.position) for k, a in enumerate(estimate.anchors)}
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    poses = selection.placement
    for name, pose in poses.items():
        values.insert(factors.X(stations[name]), factors.to_gtsam(pose))
    first = next(iter(poses))
    graph.push_back(factors.gauge_factor(stations[first], poses[first]))
    for match in selection.used:
        graph.push_back(factors.match_factor(match, stations[match.target], stations[match.source]))
    for k, position in placed.values():
        values.insert(factors.L(k), np.zeros(2) if position is None else position)
        graph.push_back(factors.anchor_prior(k, values.atPoint2(factors.L(k)), 10.0))
    for link in estimate.links:
        if link.rejection is None and link.station in poses:
            noise = gtsam.noiseModel.Isotropic.Sigma(1, max(link.sigma, 0.1))
            ends = factors.X(stations[link.station]), factors.L(placed[link.anchor][0])
            graph.push_back(gtsam.RangeFactor2D(*ends, link.distance, noise))

    benchmark.pedantic(
        lambda: gtsam.LevenbergMarquardtOptimizer(graph, values).optimize(), rounds=rounds(size)
    )
    noted(
        benchmark, site, size, reference="joint solve",
        what="GTSAM's Levenberg-Marquardt, once, on the same matches and links",
    )  # fmt: skip


def bench_whole(benchmark: Any, site: Site, size: int) -> None:
    """As a user runs it; the profile is of another run in this process."""
    peaks = []

    def solve() -> None:
        command = [PROGRAM, "solve", str(site.folder), "--out", str(site.scratch / "whole")]
        peaks.append(run_measured([*command, "--workers", "2"])[1])

    benchmark.pedantic(solve, rounds=1)
    profile = cProfile.Profile()
    survey = site.need("reading")
    profile.runcall(solve_survey, survey, SETTINGS)
    noted(
        benchmark, site, size, whole=True, peak_mb=max(peaks), profile=_hottest(profile),
    )  # fmt: skip


def _hottest(profile: cProfile.Profile, count: int = 12) -> list[list[Any]]:
    """Name, calls, own share of the time: the functions that most time is spent in."""
    stats = pstats.Stats(profile, stream=io.StringIO())
    total = stats.total_tt  # type: ignore[attr-defined]
    rows = []
    for (path, _, name), (_, calls, own, _, _) in stats.stats.items():  # type: ignore[attr-defined]
        parts = Path(path).parts
        home = ".".join(parts[parts.index("slam_uwb") + 1 :]) if "slam_uwb" in parts else ""
        rows.append([f"{home}: {name}" if home else name, calls, own / total])
    return sorted(rows, key=lambda row: -row[2])[:count]
