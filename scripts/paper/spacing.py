"""Scans three metres apart are hard: share of right matches against spacing, as in [2]."""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from slam_uwb import PRESETS, Pose2, Settings, simulate_survey
from slam_uwb.matching import index_scans, match_pair
from slam_uwb.report import Curve, draw_curves, figure_png
from slam_uwb.scan import prepare_scan

from .experiment import SHORT
from .run import Claim, Run, Section, markdown_table

EDGES = (0.9, 1.5, 2.0, 2.5, 3.0, 3.5, 4.5)
SCENES = ("flat", "paper-office")
PAIRS_A_BIN = 4
MATCHERS = {
    "the paper's (landmark, paper_lm)": PRESETS["paper"].matching,
    "correlative, point_to_line": Settings().matching,
}
RIGHT_M, RIGHT_DEG = 0.1, 2.0


def matched(task: tuple[str, int]) -> dict[str, list[tuple[float, bool]]]:
    """Distance, and whether the best match is right, of some pairs of one survey, by matcher."""
    scene, seed = task
    made = simulate_survey(scene, seed, lidar=SHORT)
    poses = {n: Pose2(p.x, p.y, p.theta) for n, p in made.reference.stations.items()}
    scans = {
        s.id: prepare_scan(s.id, s.scan, Settings().scan) for s in made.survey.stations if s.scan
    }
    chosen = _pairs(poses, np.random.default_rng(seed))
    found: dict[str, list[tuple[float, bool]]] = {}
    for name, settings in MATCHERS.items():
        indexed = index_scans(scans, settings)
        rows = found.setdefault(name, [])
        for m, n in chosen:
            truth = poses[m].inverse() @ poses[n]
            best = match_pair(indexed[m], indexed[n], settings)
            right = bool(best) and _right(best[0].target_T_source, truth)
            rows.append((poses[m].distance_to(poses[n]), right))
    return found


def make(run: Run) -> Section:
    """Figure and claim."""
    tasks = [(scene, seed) for scene in SCENES for seed in run.seeds]
    results = run.each("spacing", matched, tasks)
    middles = [0.5 * (a + b) for a, b in pairwise(EDGES)]
    rows, curves, shares = [], {}, {}
    for name in MATCHERS:
        pairs = np.array([pair for r in results for pair in r[name]], dtype=float)
        inside = [pairs[(pairs[:, 0] >= a) & (pairs[:, 0] < b), 1] for a, b in pairwise(EDGES)]
        shares[name] = [float(part.mean()) if len(part) else float("nan") for part in inside]
        intervals = [_binomial(part) for part in inside]
        low, high = ([interval[k] for interval in intervals] for k in (0, 1))
        curves[name] = Curve(middles, shares[name], low, high)
        rows.append([name, *(f"{100 * p.mean():.0f} % of {len(p)}" for p in inside if len(p))])
    figure = draw_curves(
        "best match right, all pairs of stations by distance",
        ("distance / m", "share right"),
        curves,
    )
    run.write("spacing.png", figure_png(figure))
    head = ["", *(f"{a:g}-{b:g} m" for a, b in pairwise(EDGES))]
    text = (
        f"![spacing](spacing.png)\n\nScenes {' and '.join(SCENES)}, pairs in other rooms too, recordings of 10 s; "
        f"right is within {RIGHT_M} m and {RIGHT_DEG:g} degrees of the truth.\n\n"
        + markdown_table(head, rows)
    )
    paper = shares["the paper's (landmark, paper_lm)"]
    claim = Claim(
        "scans 3 m apart are hard (paper's matching)",
        "some needed fitting by hand [2]",
        f"{100 * paper[0]:.0f} % at about 1 m, {100 * paper[4]:.0f} % at 3 to 3.5 m",
        "less than at 1 m",
        None if run.quick else paper[4] < paper[0],
    )
    return Section("Scans three metres apart are hard", text, (claim,))


def _pairs(poses: dict[Any, Pose2], rng: np.random.Generator) -> list[tuple[Any, Any]]:
    """A few pairs of every distance."""
    chosen = []
    for low, high in pairwise(EDGES):
        pairs = [
            (m, n)
            for m, n in combinations(poses, 2)
            if low <= poses[m].distance_to(poses[n]) < high
        ]
        kept = rng.permutation(len(pairs))[:PAIRS_A_BIN]
        chosen += [pairs[k] for k in kept.tolist()]
    return chosen


def _right(found: Pose2, truth: Pose2) -> bool:
    near = found.distance_to(truth) <= RIGHT_M
    return near and found.angle_to(truth) <= math.radians(RIGHT_DEG)


def _binomial(right: np.ndarray) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if not len(right):
        return float("nan"), float("nan")
    n, p, z = len(right), float(right.mean()), 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return middle - half, middle + half
