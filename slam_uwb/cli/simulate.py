"""``slam-uwb simulate``: a survey folder with its truth, from one seed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import NewSurveyOption, VerboseOption
from .targets import refuse_survey_target

if TYPE_CHECKING:
    from ..simulate import Radio, Simulation


def list_scenes(wanted: bool) -> None:
    """Print the scenes and leave."""
    if not wanted:
        return
    from ..simulate import SCENES

    for name in (*SCENES, "random-floor-N (N rooms)"):
        typer.echo(name)
    raise typer.Exit


_SceneArgument = Annotated[
    str,
    typer.Argument(metavar="SCENE", show_default=False, help="One of `slam-uwb simulate --list`."),
]
_SeedOption = Annotated[
    int,
    typer.Option(
        min=0, metavar="N", show_default=False, help="The same seed gives the same survey."
    ),
]
_TwoWayOption = Annotated[
    bool,
    typer.Option(
        "--two-way", help="Record two-way-ranging periods (twr.csv) instead of distances."
    ),
]
_DurationOption = Annotated[
    float | None,
    typer.Option(min=1.0, max=3600.0, metavar="S", help="Seconds recorded at each station."),
]
_NoSequenceOption = Annotated[
    bool, typer.Option("--no-sequence", help="Leave out which scan follows which.")
]
_TagsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        show_default=False,
        help="Write what the same anchors hear of static tags (DIR/static) and of a person who "
        "walks (DIR/walk), for `position`.",
    ),
]
_ListOption = Annotated[
    bool,
    typer.Option("--list", callback=list_scenes, is_eager=True, help="List the scenes and exit."),
]


def simulate(
    scene: _SceneArgument,
    seed: _SeedOption,
    out: NewSurveyOption,
    two_way: _TwoWayOption = False,
    duration_s: _DurationOption = None,
    no_sequence: _NoSequenceOption = False,
    tags: _TagsOption = None,
    _list: _ListOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Record an imaginary building: scans, ranges and the truth.

    `evaluate` compares a solution with the truth in reference/, which no solver opens.
    """
    from ..io import write_survey
    from ..simulate import Lidar, Radio, simulate_survey

    refuse_survey_target(out)
    if tags is not None:
        refuse_survey_target(tags)
    lidar, radio = Lidar(), Radio()
    if duration_s is not None:
        upper_s = min(duration_s, lidar.upper_duration)
        lidar = replace(lidar, duration=duration_s, upper_duration=upper_s)
        radio = replace(radio, duration=duration_s)
    made = simulate_survey(
        scene, seed, lidar=lidar, radio=radio, two_way=two_way, sequence=not no_sequence
    )
    truth = {
        (str(station), str(anchor)): item for (station, anchor), item in made.link_truth.items()
    }
    write_survey(made.survey, out, reference=made.reference, link_truth=truth, compress=True)
    if tags is not None:
        _write_tags(made, seed, radio, tags)
    typer.echo(
        f"{made.survey.name}: {len(made.survey.stations)} stations, "
        f"{len(made.survey.anchors)} anchors, in {out}"
    )


def _write_tags(made: Simulation, seed: int, radio: Radio, folder: Path) -> None:
    from ..io.folder_swap import replace_folder
    from ..io.tag_recording import tag_recording_files
    from ..simulate import simulate_static_tags, simulate_walk

    recordings = {
        "static": simulate_static_tags(made.scene, seed, radio=radio),
        "walk": simulate_walk(made.scene, seed, radio=radio),
    }
    files = {
        f"{name}/{file}": content
        for name, item in recordings.items()
        for file, content in tag_recording_files(item.recording, item.truth).items()
    }
    replace_folder(folder, files)
