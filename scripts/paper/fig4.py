"""Fig. 4: landmarks and a corresponding triple of one pair; the initial and the refined fit."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from slam_uwb import PRESETS, Pose2, Settings, simulate_survey
from slam_uwb.matching import REFINERS, index_scans
from slam_uwb.matching.landmark import closest_point_count, landmark_matches
from slam_uwb.model.products import PreparedScan
from slam_uwb.report import draw_match_steps, figure_png
from slam_uwb.scan import prepare_scan

from .experiment import SCENE
from .run import Claim, Run, Section

PAIR = ("s01", "s02")


def make(run: Run) -> Section:
    """The steps of Algorithms 2 to 4 on the first pair of one survey, recorded for a whole minute."""
    made = simulate_survey(SCENE, run.seeds[0])
    paper = PRESETS["paper"].matching
    scans = {
        name: prepare_scan(name, made.survey.station(name).scan, Settings().scan) for name in PAIR
    }
    target, source = (index_scans(scans, paper)[name] for name in PAIR)
    initial = landmark_matches(target, source, paper)
    refined = REFINERS["paper_lm"](target, source, initial, paper).poses
    places = [made.reference.stations[name] for name in PAIR]
    m, n = (Pose2(p.x, p.y, p.theta) for p in places)
    truth = m.inverse() @ n
    # Algorithm 4 returns the refined pose with the most points near the other scan.
    best = int(np.argmax(closest_point_count(target, source, refined, paper.closest_point_m)))
    first, last = Pose2.from_vector(initial[best]), Pose2.from_vector(refined[best])
    figure = draw_match_steps(
        scans[PAIR[0]],
        scans[PAIR[1]],
        corresponding_triple(scans[PAIR[0]], scans[PAIR[1]], first),
        [
            (f"initial fit, {100 * first.distance_to(truth):.1f} cm off", first),
            (f"refined fit, {100 * last.distance_to(truth):.1f} cm off", last),
        ],
    )
    run.write("fig4.png", figure_png(figure))
    text = (
        f"![fig. 4](fig4.png)\n\nScans {PAIR[0]} and {PAIR[1]}, one minute each: wall lines, their intersections "
        f"(virtual ones too), three of them that correspond, and the scans at the initial and the refined pose. "
        f"Of the five initial poses that Algorithm 3 hands on, number {best + 1} became the one that Algorithm 4 "
        "returns.\n"
    )
    claim = Claim(
        "refining brings the scans together",
        "Fig. 4b",
        f"{100 * first.distance_to(truth):.1f} cm to {100 * last.distance_to(truth):.1f} cm",
        "3 cm",
        last.distance_to(truth) < 0.03,
    )
    return Section("Fig. 4: one match", text, (claim,))


def corresponding_triple(
    target: PreparedScan, source: PreparedScan, target_T_source: Pose2
) -> tuple[np.ndarray, np.ndarray]:
    """(3, 2) m landmarks of either scan that the pose brings together, spread as far as may be."""
    moved = target_T_source.transform(source.landmarks)
    gaps = np.linalg.norm(target.landmarks[:, None] - moved, axis=-1)
    # Far virtual intersections correspond too, but leave the picture.
    near = np.linalg.norm(target.landmarks, axis=1) < 8.0
    close = [(i, int(j)) for i, j in enumerate(gaps.argmin(axis=1)) if near[i]]
    close = sorted(close, key=lambda pair: gaps[pair])[:12]

    def area(three: tuple[tuple[int, int], ...]) -> float:
        a, b, c = (target.landmarks[i] for i, _ in three)
        return float(abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]))

    chosen = max(combinations(close, 3), key=area)
    return (
        target.landmarks[[i for i, _ in chosen]],
        source.landmarks[[j for _, j in chosen]],
    )
