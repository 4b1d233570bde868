"""``slam-uwb evaluate``: a solution against ground truth."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, SolutionArgument, VerboseOption
from .solved_survey import read_solved_survey


class Align(StrEnum):
    """What the solution is aligned on."""

    AUTO = "auto"
    STATIONS = "stations"
    ANCHORS = "anchors"
    BOTH = "both"
    UNALIGNED = "unaligned"


_ReferenceOption = Annotated[
    Path,
    typer.Option(
        metavar="DIR",
        show_default=False,
        help="Folder with the true anchors.csv and stations.csv.",
    ),
]
_FigureOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", show_default=False, help="Draw solution and truth to this PNG file."
    ),
]
_AlignOption = Annotated[
    Align,
    typer.Option(
        metavar="WHAT",
        help="What the solution is aligned on before it is scored: stations, anchors, both, "
        "unaligned, or auto: nothing in a site frame, else the stations, else the anchors.",
    ),
]
_TumOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        show_default=False,
        help="Write the stations' poses to estimate.tum and reference.tum there, for evo and "
        "other tools; the time stamp is the station's number.",
    ),
]


def evaluate(
    out: SolutionArgument,
    reference: _ReferenceOption,
    as_json: JsonOption = False,
    figure: _FigureOption = None,
    align: _AlignOption = Align.AUTO,
    tum: _TumOption = None,
    _verbose: VerboseOption = False,
) -> None:
    """Compare a solution with ground truth.

    Aligned rigidly, without scale, on the stations that are ok (not at all in a site frame);
    anchors are scored in that frame, and what was not placed is counted.
    """
    from ..evaluate import (
        estimate_to_tum,
        evaluate_solution,
        evaluation_to_json,
        format_evaluation,
        reference_to_tum,
    )
    from ..io import read_reference

    solution, truth = read_solved_survey(out), read_reference(reference)
    evaluation = evaluate_solution(solution, truth, align.value)
    if figure is not None:
        from ..report import draw_solution, figure_png

        drawing = draw_solution(solution, reference=truth, evaluation=evaluation)
        figure.write_bytes(figure_png(drawing))
    if tum is not None:
        tum.mkdir(parents=True, exist_ok=True)
        (tum / "estimate.tum").write_text(estimate_to_tum(solution), encoding="utf-8")
        (tum / "reference.tum").write_text(reference_to_tum(solution, truth), encoding="utf-8")
    text = (
        json.dumps(evaluation_to_json(evaluation), indent=2)
        if as_json
        else format_evaluation(evaluation)
    )
    typer.echo(text)
