"""The paper's two experiments in one simulated office: what the tables and figures over seeds rest on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from slam_uwb import Pose2, Settings, Solution, Survey, evaluate_solution, solve_survey
from slam_uwb.evaluate import settings_as_printed, static_errors, trajectory_errors
from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.solution import Status
from slam_uwb.model.survey import KnownPlace
from slam_uwb.positioning import locate_stays, track_tag
from slam_uwb.simulate import (
    Lidar,
    Radio,
    Simulation,
    TagSimulation,
    simulate_static_tags,
    simulate_survey,
    simulate_walk,
)

SCENE = "paper-office"
SHORT = Lidar(duration=10.0, upper_duration=0.0)
"""Sweeps over seeds record 10 s a station: the median a degree is then of 14 samples instead of 83."""
METHODS: dict[str, Settings] = {
    "as printed": settings_as_printed(),
    "sequential": Settings(graph=GraphSettings(mode="sequential")),
    "joint": Settings(),
}


def experiment(seed: int) -> dict[str, Any]:
    """Both experiments of one seed: anchor errors by method, positioning errors by anchor set."""
    made = simulate_survey(SCENE, seed, lidar=SHORT)
    solutions = {name: solved(made, settings) for name, settings in METHODS.items()}
    calibrated = simulate_survey(SCENE, seed, lidar=SHORT, radio=Radio(offset=0.0))
    solutions["sequential, offset calibrated"] = solved(calibrated, METHODS["sequential"])
    result: dict[str, Any] = {name: scores(made, s) for name, s in solutions.items()}
    static, walk = simulate_static_tags(made.scene, seed), simulate_walk(made.scene, seed)
    for name in ("reference", "joint", "sequential"):
        located = anchors_of(made, solutions.get(name))
        if located is not None:
            result[f"positioning, {name}"] = positioning(static, walk, *located)
    return result


def solved(made: Simulation, settings: Settings) -> Solution | None:
    """None where the survey cannot be solved."""
    try:
        return solve_survey(made.survey, settings)
    except SlamUwbError:
        return None


def scores(made: Simulation, solution: Solution | None) -> dict[str, Any]:
    """Errors of the anchors that are `ok`, by name, as far as any are known, and counts."""
    if solution is None:
        return {"rmse": None, "rmse_placed": None, "errors": {}, "stations_ok": 0, "nees": None}
    evaluation = evaluate_solution(solution, made.reference)
    nees, dof = evaluation.anchors.ok_nees
    ok = [item for item in evaluation.anchors.items if item.status is Status.OK]
    # Fewer than two stations align nothing: no error is known then.
    known = [item for item in ok if math.isfinite(item.error)]
    return {
        "rmse": evaluation.anchors.ok_errors.rmse,
        "rmse_placed": evaluation.anchors.placed_errors.rmse,
        "errors": {item.id: item.error for item in known},
        "stations_ok": sum(i.status is Status.OK for i in evaluation.stations.items),
        "station_rmse": evaluation.stations.ok_errors.rmse,
        "nees": nees / dof if dof else None,
    }


def anchors_of(
    made: Simulation, solution: Solution | None
) -> tuple[dict[Any, np.ndarray], Pose2] | None:
    """Places (3,) of the anchors to locate with, and reference_T_anchors; the true ones without a solution.

    The solution's frame is brought to the reference's by its stations: the paper does not say how.
    """
    heights = {a.id: float(a.height or 0.0) for a in made.survey.anchors}
    if solution is None:
        places = {n: np.array([p.x, p.y, heights[n]]) for n, p in made.reference.anchors.items()}
        return places, Pose2.identity()
    pose = evaluate_solution(solution, made.reference).reference_T_world
    found = {
        a.id: np.array([*a.position, heights[a.id]])
        for a in solution.anchors
        if a.position is not None and a.status is Status.OK
    }
    return (found, pose) if found and pose is not None else None


def positioning(
    static: TagSimulation, walk: TagSimulation, anchors: dict[Any, np.ndarray], pose: Pose2
) -> dict[str, Any]:
    """Errors of the static tags and of the walk with one set of anchors."""
    settings = Settings().positioning
    stays = locate_stays(static.recording, anchors, settings)
    heard = walk.recording
    track = track_tag(heard.epochs, anchors, heard.tag_height, settings, heard.power_law)
    path = np.empty((0, 2)) if walk.truth.path is None else walk.truth.path
    return {
        "static": list(static_errors(stays, static.truth, pose).values()),
        "walk": trajectory_errors(track, path, pose).tolist(),
        "anchors": len(anchors),
    }


def surveyed(made: Simulation) -> Survey:
    """The survey with its tripod at known places (1 cm, 0.1 degrees) and no scans: ranges alone count."""
    stations = tuple(
        replace(
            station,
            scan=None,
            upper_scan=None,
            known=KnownPlace(place.x, place.y, 0.01, place.theta, 0.0017),
        )
        for station, place in zip(
            made.survey.stations, made.reference.stations.values(), strict=True
        )
    )
    return replace(made.survey, stations=stations, sequence=None)


__all__ = [
    "METHODS", "SCENE", "SHORT", "anchors_of", "experiment", "positioning",
    "scores", "solved", "surveyed",
]  # fmt: skip
