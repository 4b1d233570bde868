"""Are ranges of two anchors that were exchanged at one station called out? On simulated surveys, drawn at random.

    python scripts/swapped_identifiers.py --first 900 --seeds 20 --clean 30

Four seconds at each station, an office and a flat in turn. The ranges of two anchors are exchanged at a random
station. Named: the solution says so of both links. Doubted: one of the two anchors is `ok` no longer.
Neither: the anchors are as good as without (`passed`), or one that is `ok` has moved by more than 0.3 m
and three of its sigmas (`harmful`).
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from slam_uwb import Solution, simulate_survey, solve_survey
from slam_uwb.model.survey import Survey
from slam_uwb.simulate import Lidar, Radio

SCENES = ("paper-office", "flat")
MOVED_M, MOVED_SIGMAS = 0.3, 3.0


def recorded(seed: int) -> Survey:
    """One survey."""
    lidar, radio = Lidar(duration=4.0, upper_duration=0.0), Radio(duration=4.0)
    return simulate_survey(SCENES[seed % len(SCENES)], seed, lidar=lidar, radio=radio).survey


def swap(survey: Survey, station: str, one: str, two: str) -> Survey:
    """The survey with the ranges of two anchors exchanged at a station."""
    other = {one: two, two: one}
    ranges = tuple(
        replace(k, anchor=other.get(k.anchor, k.anchor)) if k.station == station else k  # type: ignore[call-overload]
        for k in survey.ranges
    )
    return replace(survey, ranges=ranges)


def draw(survey: Survey, seed: int) -> tuple[str, str, str]:
    """A station and two anchors that it hears."""
    rng = np.random.default_rng([seed, 91])
    heard: dict[str, list[str]] = {}
    for link in survey.ranges:
        heard.setdefault(str(link.station), []).append(str(link.anchor))
    pairs = [(s, a, b) for s, names in heard.items() for a, b in combinations(sorted(names), 2)]
    return pairs[int(rng.integers(len(pairs)))]


def named(solution: Solution) -> set[tuple[str, str]]:
    """(station, anchor) of the links that are said to be swapped."""
    return {
        (str(k.station), str(k.anchor)) for k in solution.links if "swapped" in (k.rejection or "")
    }


def judge(clean: Solution, spoilt: Solution, station: str, one: str, two: str) -> str:
    """What became of a swap."""
    found = named(spoilt)
    if found == {(station, one), (station, two)}:
        return "named"
    if found:
        return "named otherwise"
    before = {anchor.id: anchor for anchor in clean.anchors}
    for anchor in spoilt.anchors:
        start = before[anchor.id].position
        if anchor.status != "ok" or anchor.position is None or start is None:
            continue
        moved = float(np.linalg.norm(np.asarray(anchor.position) - np.asarray(start)))
        sigma = float(np.sqrt(np.linalg.eigvalsh(anchor.covariance)[-1]))
        if moved > max(MOVED_M, MOVED_SIGMAS * sigma):
            return f"harmful: {anchor.id} moved by {moved:.2f} m"
    after = {anchor.id: anchor.status for anchor in spoilt.anchors}
    doubted = [a for a in (one, two) if before[a].status == "ok" and after[a] != "ok"]
    return f"doubted: {', '.join(doubted)}" if doubted else "passed"


def main() -> None:
    """Print each survey, and how often which."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=900)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--clean", type=int, default=30, help="further surveys without a swap")
    arguments = parser.parse_args()
    outcomes, alarms = Counter[str](), 0
    last = arguments.first + arguments.seeds
    for seed in range(arguments.first, last + arguments.clean):
        survey = recorded(seed)
        clean = solve_survey(survey)
        alarms += bool(named(clean))
        if named(clean):
            print(f"{seed} {SCENES[seed % 2]}: false alarm {sorted(named(clean))}", flush=True)
        if seed >= last:
            continue
        station, one, two = draw(survey, seed)
        means = {str(k.anchor): k.distances.mean() for k in survey.ranges if k.station == station}
        outcome = judge(clean, solve_survey(swap(survey, station, one, two)), station, one, two)
        outcomes[outcome.split(":")[0]] += 1
        apart = abs(means[one] - means[two])
        where = f"{seed} {SCENES[seed % 2]} {station} {one}/{two}, {apart:.2f} m apart"
        print(f"{where}: {outcome}", flush=True)
    print(", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common()))
    print(f"{alarms} of {arguments.seeds + arguments.clean} clean surveys with a false alarm")


if __name__ == "__main__":
    main()
