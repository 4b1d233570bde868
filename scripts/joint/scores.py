"""What one estimate is worth, and the figures of many."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from slam_uwb import Pose2, Reference, Solution, evaluate_solution
from slam_uwb.evaluate import ItemEvaluation
from slam_uwb.model.solution import Status
from slam_uwb.model.survey import ReferencePlace

ELLIPSE = 0.95
FAR_SIGMAS = 5.0


@dataclass(frozen=True, slots=True)
class Score:
    """Anchors of one solution, after rigid alignment on its `ok` stations."""

    anchors: int
    placed: int
    ok: int
    rmse: float
    """m, of all of which anything is known: where no place is given, of the likeliest alternative."""
    inside: int
    """`ok` ones inside their 95 % ellipse."""
    judged: int
    """`ok` ones with an ellipse."""
    far: int
    """`ok` ones off by more than five stated sigmas."""
    station_rmse: float
    """m, of the `ok` stations."""


def score(solution: Solution | None, reference: Reference) -> Score:
    """Score a solution; None is one that places nothing."""
    if solution is None:
        return Score(len(reference.anchors), 0, 0, math.nan, 0, 0, 0, math.nan)
    evaluation = evaluate_solution(solution, reference)
    anchors = evaluation.anchors
    inside, judged, far = coverage(anchors.items)
    return Score(
        anchors=anchors.expected,
        placed=anchors.expected - anchors.unplaced,
        ok=len(anchors.items) - len(anchors.not_ok),
        rmse=evaluate_solution(_decided(solution), reference).anchors.placed_errors.rmse,
        inside=inside,
        judged=judged,
        far=far,
        station_rmse=evaluation.stations.ok_errors.rmse,
    )


def _decided(solution: Solution) -> Solution:
    """The solution, had it chosen where it says that it cannot tell; so that no method gains by doubt."""
    anchors = []
    for anchor in solution.anchors:
        if anchor.position is None and anchor.alternatives:
            best = max(anchor.alternatives, key=lambda place: place.weight)
            anchor = replace(anchor, position=np.array([best.x, best.y]))
        anchors.append(anchor)
    return replace(solution, anchors=tuple(anchors))


def coverage(items: Sequence[ItemEvaluation]) -> tuple[int, int, int]:
    """Of the `ok` items with an ellipse: inside of it at 95 %, all, and further than five sigmas."""
    from scipy.stats import chi2

    judged = [i for i in items if i.status is Status.OK and i.nees_dof]
    inside = sum(i.nees <= chi2.ppf(ELLIPSE, i.nees_dof) for i in judged)
    return int(inside), len(judged), sum(i.nees > FAR_SIGMAS**2 for i in judged)


def in_frame_of(solution: Solution, reference: Reference) -> Reference:
    """True places in the solution's frame, without headings: an ellipse is one of places."""
    gauge = next(s for s in solution.stations if s.id == solution.frame)
    true = reference.stations[gauge.id]
    world_T_reference = gauge.pose @ Pose2(true.x, true.y, true.theta).inverse()

    def moved(place: ReferencePlace) -> ReferencePlace:
        x, y = world_T_reference.transform((place.x, place.y))
        return ReferencePlace(float(x), float(y))

    return Reference(
        {name: moved(place) for name, place in reference.stations.items()},
        {name: moved(place) for name, place in reference.anchors.items()},
    )


def median_worst(values: Iterable[float]) -> tuple[float, float]:
    """Median and largest of those that are known; NaN where none is."""
    known = [value for value in values if math.isfinite(value)]
    return (float(np.median(known)), max(known)) if known else (math.nan, math.nan)


def share(part: int, whole: int) -> str:
    """`96.4 % of 336`."""
    return f"{100.0 * part / whole:.1f} % of {whole}" if whole else "none"


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
