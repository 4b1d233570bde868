"""Modes and matchers side by side on the same surveys: one row a method and survey."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from ..model.errors import SlamUwbError
from ..model.products import Progress, Share, alone, silent
from ..model.settings import PRESETS, Settings
from ..model.solution import Solution, Status
from ..model.survey import Reference, Survey
from .align import evaluate_solution
from .evaluation import Evaluation
from .statistics import pooled_nees

_log = logging.getLogger(__name__)
_NAN = float("nan")

MODES = ("joint", "sequential")
INITIALISERS = ("correlative", "landmark")
REFINERS = ("point_to_line", "paper_lm", "open3d", "kiss_icp")
AS_PRINTED = "the paper as printed"


@dataclass(frozen=True, slots=True)
class Method:
    """One way to solve a survey."""

    name: str
    settings: Settings

    @property
    def mode(self) -> str:
        """`joint` or `sequential`."""
        return self.settings.graph.mode


@dataclass(frozen=True, slots=True)
class MethodResult:
    """One method on one survey; errors are of what the method itself calls `ok`."""

    survey: str
    method: str
    mode: str
    initialiser: str
    refiner: str
    stations: int = 0
    """How many the survey has."""
    stations_ok: int = 0
    station_rmse: float = _NAN
    """m; NaN without a reference."""
    anchors: int = 0
    anchors_ok: int = 0
    anchor_rmse: float = _NAN
    """m; NaN without a reference."""
    anchor_max: float = _NAN
    """m."""
    anchor_errors: tuple[float, ...] = ()
    """m, of the `ok` anchors that the reference knows, in the survey's order."""
    anchor_nees: float = _NAN
    """NEES / dof of the `ok` anchors; 1 where the covariances are right."""
    seconds: float = _NAN
    """Of the whole solve."""
    failure: str = ""
    """Why there is no result; empty where there is one."""


def methods(
    modes: Iterable[str] = MODES,
    initialisers: Iterable[str] = INITIALISERS,
    refiners: Iterable[str] = REFINERS,
    *,
    as_printed: bool = True,
) -> tuple[Method, ...]:
    """All combinations, matchers first, and the paper as printed (its own matching along the sequence)."""
    found = [
        Method(
            f"{mode}, {initialiser}, {refiner}", _settings(Settings(), mode, initialiser, refiner)
        )
        for initialiser, refiner, mode in product(initialisers, refiners, modes)
    ]
    if as_printed:
        found.append(Method(AS_PRINTED, settings_as_printed()))
    return tuple(found)


def settings_as_printed() -> Settings:
    """The paper's numbers and matching along the sequence, `sequential`."""
    paper = PRESETS["paper"]
    matching = paper.matching.model_copy(update={"pairs": "sequence"})
    graph = paper.graph.model_copy(update={"mode": "sequential"})
    return paper.model_copy(update={"matching": matching, "graph": graph})


def compare_methods(
    survey: Survey,
    reference: Reference | None,
    compared: Sequence[Method],
    clock: Callable[[], float],
    progress: Progress = silent,
    share: Share = alone,
) -> tuple[MethodResult, ...]:
    """Solve one survey by each method; a method that fails has its row and its reason.

    Args:
        survey: What was measured.
        reference: The truth; without it only counts and seconds are given.
        compared: The methods.
        clock: Seconds since any epoch, such as `time.perf_counter`.
        progress: Called with the survey's name and how many methods are done.
        share: How work is shared out among processes.
    """
    results = []
    for done, method in enumerate(compared):
        progress(survey.name, done, len(compared))
        start = clock()
        result = _result(survey, reference, method, share)
        results.append(replace(result, seconds=clock() - start))
    progress(survey.name, len(compared), len(compared))
    return tuple(results)


def _settings(settings: Settings, mode: str, initialiser: str, refiner: str) -> Settings:
    matching = settings.matching.model_copy(update={"initialiser": initialiser, "refiner": refiner})
    graph = settings.graph.model_copy(update={"mode": mode})
    return settings.model_copy(update={"matching": matching, "graph": graph})


def _result(
    survey: Survey, reference: Reference | None, method: Method, share: Share
) -> MethodResult:
    # Here, since tables of results that are there already need no solver.
    from ..pipeline import solve_survey

    matching = method.settings.matching
    empty = MethodResult(
        survey.name,
        method.name,
        method.mode,
        matching.initialiser,
        matching.refiner,
        stations=len(survey.stations),
        anchors=len(survey.anchors),
    )
    try:
        solution = solve_survey(survey, method.settings, share=share)
        evaluation = None if reference is None else evaluate_solution(solution, reference)
    except SlamUwbError as error:
        return replace(empty, failure=str(error))
    except Exception as error:
        # A library that gives up on one survey must not cost the table its other rows.
        _log.debug("traceback", exc_info=error)
        return replace(empty, failure=f"internal error: {type(error).__name__}: {error}")
    return _scored(empty, solution, evaluation)


def _scored(row: MethodResult, solution: Solution, evaluation: Evaluation | None) -> MethodResult:
    row = replace(
        row,
        stations_ok=sum(item.status is Status.OK for item in solution.stations),
        anchors_ok=sum(item.status is Status.OK for item in solution.anchors),
    )
    if evaluation is None:
        return row
    anchors = evaluation.anchors
    errors = [
        item.error for item in anchors.items if item.status is Status.OK and item.error >= 0.0
    ]
    return replace(
        row,
        station_rmse=evaluation.stations.ok_errors.rmse,
        anchor_rmse=anchors.ok_errors.rmse,
        anchor_max=anchors.ok_errors.max,
        anchor_errors=tuple(errors),
        anchor_nees=pooled_nees([anchors.ok_nees]),
    )
