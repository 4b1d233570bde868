"""``slam-uwb compare``: modes and matchers side by side."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import VerboseOption
from .progress import progress_bar
from .solve import Mode
from .summary import print_warnings

if TYPE_CHECKING:
    from ..evaluate.comparison import MethodResult
    from ..model.survey import Reference, Survey

TABLE = "comparison.csv"


class Initialiser(StrEnum):
    """How initial matches are found."""

    CORRELATIVE = "correlative"
    LANDMARK = "landmark"


class Refiner(StrEnum):
    """How they are refined."""

    POINT_TO_LINE = "point_to_line"
    PAPER_LM = "paper_lm"
    OPEN3D = "open3d"
    KISS_ICP = "kiss_icp"


def compare(
    surveys: Annotated[
        list[Path],
        typer.Argument(
            metavar="SURVEY...",
            show_default=False,
            help="Survey folders; errors are given where one has its truth in reference/.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            metavar="OUT",
            show_default=False,
            help="Folder to write: comparison.csv, .md, .tex and .png. A comparison already there "
            "is replaced when the new one is complete.",
        ),
    ],
    mode: Annotated[
        list[Mode] | None,
        typer.Option(
            metavar="NAME",
            show_default="both",
            help="Only joint or sequential; may be given several times.",
        ),
    ] = None,
    initialiser: Annotated[
        list[Initialiser] | None,
        typer.Option(metavar="NAME", show_default="both", help="Only correlative or landmark."),
    ] = None,
    refiner: Annotated[
        list[Refiner] | None,
        typer.Option(
            metavar="NAME",
            show_default="all",
            help="Only point_to_line, paper_lm, open3d or kiss_icp; may be given several times.",
        ),
    ] = None,
    workers: Annotated[
        int, typer.Option(min=1, metavar="N", help="Processes that match scans.")
    ] = 1,
    _verbose: VerboseOption = False,
) -> None:
    """Solve surveys by every mode, initialiser and refiner, and put them side by side.

    The paper as printed is one of the methods. A method that fails has its row and its reason.
    """
    from ..io.folder_swap import refuse_foreign, replace_folder

    refuse_foreign(out, TABLE, "comparison")
    found = [_read(folder) for folder in surveys]
    results = _compare(found, mode, initialiser, refiner, workers)
    from ..evaluate import comparison_to_csv, comparison_to_latex, comparison_to_markdown
    from ..report import draw_comparison, figure_png

    table = comparison_to_markdown(results)
    files = {
        TABLE: comparison_to_csv(results).encode(),
        "comparison.md": table.encode(),
        "comparison.tex": comparison_to_latex(results).encode(),
        "comparison.png": figure_png(draw_comparison(results)),
    }
    replace_folder(out, files)
    typer.echo(table)
    typer.echo(f"comparison  {out}")


def _read(folder: Path) -> tuple[Survey, Reference | None]:
    """A survey and its truth; every fault of it is raised before anything is solved."""
    from ..io import check_survey, read_reference
    from ..model.errors import SurveyFormatError

    result = check_survey(folder)
    print_warnings(map(str, result.warnings))
    if result.survey is None or result.faults:
        raise SurveyFormatError(result.faults)
    inside = folder / "reference"
    return result.survey, read_reference(inside) if inside.is_dir() else None


def _compare(
    surveys: list[tuple[Survey, Reference | None]],
    modes: list[Mode] | None,
    initialisers: list[Initialiser] | None,
    refiners: list[Refiner] | None,
    workers: int,
) -> list[MethodResult]:
    import time

    from ..evaluate import compare_methods
    from ..evaluate.comparison import INITIALISERS, MODES, REFINERS, methods

    # The paper as printed is one fixed combination: asked for others, it is left out.
    everything = not (modes or initialisers or refiners)
    compared = methods(
        [item.value for item in modes or ()] or MODES,
        [item.value for item in initialisers or ()] or INITIALISERS,
        [item.value for item in refiners or ()] or REFINERS,
        as_printed=everything,
    )
    results: list[MethodResult] = []
    with progress_bar() as progress:
        for survey, reference in surveys:
            results += compare_methods(
                survey, reference, compared, time.perf_counter, progress, workers
            )
    return results
