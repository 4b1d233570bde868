"""Bring a solution into the reference's frame and measure what remains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..model.geometry import FloatArray, Points, Pose2, Vector2, wrap_angle
from ..model.solution import Solution, Status
from ..model.survey import Reference, ReferencePlace
from .consistency import aligned_covariances, squared_error
from .estimates import Estimate, anchor_estimates, joint_covariance, station_estimates
from .evaluation import Alignment, AlignOn, Evaluation, GroupEvaluation, ItemEvaluation

_NOWHERE = ReferencePlace(math.nan, math.nan)


def rigid_alignment(source: Points, target: Points) -> Pose2:
    """Rotation and translation that bring `source` closest to `target` in the least-squares sense.

    Kabsch (1976) and Umeyama (1991) without scale; in the plane the rotation is one angle, so a
    reflection cannot come out and no determinant needs mending.

    Args:
        source: (N, 2) m, N >= 2.
        target: (N, 2) m, the same points in the other frame.

    Returns:
        `target_T_source`.

    Raises:
        ValueError: Shapes differ, a value is not finite, or the points leave the rotation
            undetermined (fewer than two, all in one place, or mere mirror images of each other).
    """
    source, target = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 2:
        raise ValueError(f"shapes {source.shape} and {target.shape}, expected (N, 2) twice")
    if len(source) < 2 or not (np.isfinite(source).all() and np.isfinite(target).all()):
        raise ValueError("alignment needs at least two points, all of them finite")
    centre, goal = source.mean(axis=0), target.mean(axis=0)
    a, b = source - centre, target - goal
    cosine, sine = float(np.sum(a * b)), float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    if math.hypot(cosine, sine) <= 1e-9 * np.linalg.norm(a) * np.linalg.norm(b):
        raise ValueError("the points leave the rotation undetermined")
    theta = math.atan2(sine, cosine)
    x, y = goal - Pose2(0.0, 0.0, theta).transform(centre)
    return Pose2(float(x), float(y), theta)


def evaluate_solution(
    solution: Solution, reference: Reference, align: AlignOn = "auto"
) -> Evaluation:
    """Score every station and anchor against ground truth.

    By default the solution is aligned rigidly and without scale on its `ok` stations; not at all
    where its frame is the site's. Where the reference knows fewer than two of its stations it is
    aligned on the `ok` anchors, whose errors are then flattered. Where too few are `ok`, nothing is
    scored.

    The NEES counts what the alignment does to the uncertainty; the reference is taken as exact.

    Args:
        solution: What to score.
        reference: The truth.
        align: Other choices than the default, for figures of others that were made so: on the `ok`
            anchors, on `both`, on the stations in a site frame too, or not at all.
    """
    stations, anchors = station_estimates(solution), anchor_estimates(solution)
    alignment, reference_T_world, used = _align(solution.frame, stations, anchors, reference, align)
    covariances: list[FloatArray | None] = [None] * (len(stations) + len(anchors))
    if reference_T_world is not None:
        covariances = aligned_covariances(
            [*stations, *anchors], joint_covariance(solution), reference_T_world, used
        )
    places = [_place(reference.stations, item.id) for item in stations]
    places += [_place(reference.anchors, item.id) for item in anchors]
    scores = tuple(
        _score(item, place, reference_T_world, covariance)
        for item, place, covariance in zip([*stations, *anchors], places, covariances, strict=True)
    )
    return Evaluation(
        survey_name=solution.survey_name,
        mode=solution.mode,
        alignment=alignment,
        reference_T_world=reference_T_world,
        stations=GroupEvaluation(scores[: len(stations)], _absent(stations, reference.stations)),
        anchors=GroupEvaluation(scores[len(stations) :], _absent(anchors, reference.anchors)),
    )


def _align(
    frame: str,
    stations: Sequence[Estimate],
    anchors: Sequence[Estimate],
    reference: Reference,
    align: AlignOn,
) -> tuple[Alignment, Pose2 | None, list[int]]:
    """What the alignment rests on, `reference_T_world`, and the items it used (stations first)."""
    kind: Alignment
    if align != "auto":
        kind = align
    elif frame == "site":
        kind = "site"
    else:
        places = (_place(reference.stations, item.id) for item in stations)
        kind = "stations" if sum(map(_known, places)) >= 2 else "anchors"
    if kind in ("site", "unaligned"):
        return kind, Pose2.identity(), []
    pairs = _pairs(stations, reference.stations, 0) if kind != "anchors" else []
    if kind != "stations":
        pairs += _pairs(anchors, reference.anchors, len(stations))
    source = np.array([position for _, position, _ in pairs]).reshape(-1, 2)
    target = np.array([place for _, _, place in pairs]).reshape(-1, 2)
    try:
        return kind, rigid_alignment(source, target), [k for k, _, _ in pairs]
    except ValueError:
        return "none", None, []


def _pairs(
    items: Sequence[Estimate], places: Mapping[Any, ReferencePlace], first: int
) -> list[tuple[int, Vector2, tuple[float, float]]]:
    """Number, estimate and true place of each `ok` item whose place the reference knows."""
    found = []
    for k, item in enumerate(items, first):
        place = _place(places, item.id)
        if item.status is Status.OK and item.position is not None and _known(place):
            found.append((k, item.position, (place.x, place.y)))
    return found


def _score(
    item: Estimate,
    truth: ReferencePlace,
    reference_T_world: Pose2 | None,
    covariance: FloatArray | None,
) -> ItemEvaluation:
    """Estimate minus reference, as far as both are known; `covariance` in the reference's axes."""
    placed, referenced = item.position is not None, _known(truth)
    if item.position is None or reference_T_world is None:
        return ItemEvaluation(item.id, item.status, placed, referenced)
    dx, dy = (float(v) for v in reference_T_world.transform(item.position) - (truth.x, truth.y))
    turn = reference_T_world.theta + item.heading - truth.theta
    heading_error = wrap_angle(turn) if math.isfinite(turn) else math.nan
    if not referenced:
        return ItemEvaluation(item.id, item.status, placed, referenced, heading_error=heading_error)
    errors = np.array([dx, dy, heading_error])
    nees, dof = squared_error(errors[np.isfinite(errors)], covariance)
    return ItemEvaluation(
        item.id,
        item.status,
        placed,
        referenced,
        dx,
        dy,
        math.hypot(dx, dy),
        heading_error,
        nees,
        dof,
    )


def _place(places: Mapping[Any, ReferencePlace], name: str) -> ReferencePlace:
    return places.get(name, _NOWHERE)


def _known(place: ReferencePlace) -> bool:
    return math.isfinite(place.x) and math.isfinite(place.y)


def _absent(items: Sequence[Estimate], places: Mapping[Any, ReferencePlace]) -> tuple[str, ...]:
    names = {item.id for item in items}
    return tuple(name for name, place in places.items() if _known(place) and name not in names)
