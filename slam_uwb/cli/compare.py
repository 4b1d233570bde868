"""``slam-uwb compare``: modes and matchers side by side."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import Mode, VerboseOption, WorkersOption
from .progress import progress_bar
from .sound_survey import read_sound_survey

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


_SurveysArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="SURVEY",
        show_default=False,
        help="Survey folders; errors are given where one has its truth in reference/.",
    ),
]


def _only(choices: type[StrEnum], every: str) -> Any:
    """An option that may be given several times; without it there are `every` one of the choices."""
    *first, last = choices
    names = f"{', '.join(first)} or {last}"
    return typer.Option(
        metavar="NAME", show_default=every, help=f"Only {names}; may be given several times."
    )


_ModesOption = Annotated[list[Mode] | None, _only(Mode, "both")]
_InitialisersOption = Annotated[list[Initialiser] | None, _only(Initialiser, "both")]
_RefinersOption = Annotated[list[Refiner] | None, _only(Refiner, "all")]
_OutOption = Annotated[
    Path,
    typer.Option(
        metavar="OUT",
        show_default=False,
        help="Folder to write: comparison.csv, .md, .tex and .png. A comparison already there "
        "is replaced when the new one is complete.",
    ),
]


def compare(
    surveys: _SurveysArgument,
    out: _OutOption,
    mode: _ModesOption = None,
    initialiser: _InitialisersOption = None,
    refiner: _RefinersOption = None,
    workers: WorkersOption = 1,
    _verbose: VerboseOption = False,
) -> None:
    """Put modes and matchers side by side on the same surveys.

    Every mode, initialiser and refiner solves every survey. The paper as printed is one of the
    methods. A method that fails has its row and its reason.
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
    from ..io import read_reference

    survey, inside = read_sound_survey(folder), folder / "reference"
    return survey, read_reference(inside) if inside.is_dir() else None


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
    from ..processes import sharing

    with sharing(workers, ["pipeline"]) as share, progress_bar() as progress:
        for survey, reference in surveys:
            results += compare_methods(
                survey, reference, compared, time.perf_counter, progress, share
            )
    return results
