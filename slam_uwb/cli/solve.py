"""``slam-uwb solve``: a survey folder to a solution folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .alignment import AlignOption, parse_alignment
from .options import (
    JsonOption,
    Mode,
    ModeOption,
    Pairs,
    PairsOption,
    SettingsOption,
    SurveyArgument,
    VerboseOption,
    WorkersOption,
)
from .progress import progress_bar
from .solved_survey import read_solved_survey
from .sound_survey import read_sound_survey
from .summary import print_summary, print_warnings
from .targets import refuse_solution_target

if TYPE_CHECKING:
    from ..model.settings import Settings


_OutOption = Annotated[
    Path,
    typer.Option(
        metavar="OUT",
        show_default=False,
        help="Solution folder to write. A solution already there is replaced when the new one "
        "is complete; any other folder with something in it is refused.",
    ),
]
_NoRangesOption = Annotated[
    bool, typer.Option("--no-ranges", help="Use the scans alone: map and station poses.")
]
_ContinueOption = Annotated[
    Path | None,
    typer.Option(
        "--continue",
        metavar="OUT",
        show_default=False,
        help="Solution of this survey from before it had its latest stations: only these are matched, "
        "with the settings of that solution, and the report says what moved. Refused where "
        "anything that it rests on has changed. May be the folder given with --out.",
    ),
]


def solve(
    survey: SurveyArgument,
    out: _OutOption,
    mode: ModeOption = None,
    pairs: PairsOption = None,
    settings: SettingsOption = None,
    no_ranges: _NoRangesOption = False,
    align: AlignOption = None,
    earlier: _ContinueOption = None,
    workers: WorkersOption = 1,
    as_json: JsonOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Solve one survey: floor map, stations, anchors, uncertainty.

    What cannot be told is left empty and says why in its `status`. OUT is complete or not there.
    """
    refuse_solution_target(out, survey)
    known = None if earlier is None else read_solved_survey(earlier)
    chosen = choose_settings(settings, mode, pairs, None if known is None else known.settings)
    frame = parse_alignment(align or [])

    from ..io import write_solution
    from ..processes import sharing

    with sharing(workers, ["pipeline", "report.figures"]) as share, progress_bar() as progress:
        sound = read_sound_survey(survey)
        from ..pipeline import solve_survey

        solution = solve_survey(
            sound, chosen, use_ranges=not no_ranges, align=frame, earlier=known,
            progress=progress, share=share,
        )  # fmt: skip
        progress("drawing and writing", 0, 1)
        from ..report.pictures import FIGURE, REPORT, solution_pictures

        write_solution(solution, out, extras=solution_pictures(solution, share))
        progress("drawing and writing", 1, 1)
    print_warnings(solution.warnings)
    print_summary(solution, out, out / FIGURE, out / REPORT, as_json=as_json)


def choose_settings(
    source: str | None, mode: Mode | None, pairs: Pairs | None, default: Settings | None = None
) -> Settings:
    """Settings of a preset or file (`default` where none is named), with what the command line says on top."""
    from ..io import read_settings

    settings = default if source is None and default else read_settings(source or "default")
    if mode is not None:
        settings = settings.model_copy(
            update={"graph": settings.graph.model_copy(update={"mode": mode.value})}
        )
    if pairs is not None:
        matching = settings.matching.model_copy(update={"pairs": pairs.value})
        settings = settings.model_copy(update={"matching": matching})
    return settings
