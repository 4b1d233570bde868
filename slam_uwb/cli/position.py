"""``slam-uwb position``: a tag located with the anchors that a survey found."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import JsonOption, VerboseOption
from .summary import print_warnings
from .targets import SOLUTION_FILE

if TYPE_CHECKING:
    from ..model.geometry import Pose2
    from ..model.solution import Solution
    from ..model.tag import TagRecording, TagTruth
    from .positioned import Positioned

TRACK = "track.csv"


_RecordingArgument = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING",
        show_default=False,
        help="Folder with positioning.toml, epochs.csv and, where it is known, truth.csv.",
    ),
]
_AnchorsOption = Annotated[
    Path,
    typer.Option(
        metavar="FILE",
        show_default=False,
        help="anchors.csv of a solution (those that are ok are used), or a table anchor,x_m,y_m "
        "of one's own, with z_m unless positioning.toml gives the heights.",
    ),
]
_OutOption = Annotated[
    Path | None,
    typer.Option(
        metavar="OUT",
        show_default=False,
        help="Folder to write: track.csv, places.csv, figure.png.",
    ),
]
_ReferenceOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        show_default=False,
        help="True anchors.csv and stations.csv: the same measurements are located with the "
        "true anchors too, and truth.csv is in their frame.",
    ),
]
_SettingsOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE", show_default=False, help="TOML file with a [positioning] section."
    ),
]


def position(
    recording: _RecordingArgument,
    anchors: _AnchorsOption,
    out: _OutOption = None,
    reference: _ReferenceOption = None,
    settings: _SettingsOption = None,
    as_json: JsonOption = False,
    _verbose: VerboseOption = False,
) -> None:
    """Locate a tag with the anchors that a survey found.

    By a hybrid RSS-TDOA Kalman filter, the paper's second experiment. With truth.csv the errors are
    given: of static tags the distance of the mean place, of a walk the distance to the closest point
    of the path.
    """
    from ..io import read_settings
    from ..io.folder_swap import refuse_foreign, replace_folder
    from .positioned import locate, table_files

    if out is not None:
        refuse_foreign(out, TRACK, "positioning result")
    heard, truth = _read(recording)
    chosen = read_settings("default" if settings is None else settings).positioning
    found, left_out = _places(anchors, heard)
    print_warnings(f"anchor not used: {line}" for line in left_out)
    if reference is None:
        truth = None if _is_elsewhere(anchors, truth) else truth
        results = {"found anchors": locate(heard, found, chosen, truth, None)}
    else:
        pose = _frame(anchors, found, reference)
        true_anchors, _ = _places(reference, heard)
        results = {
            "found anchors": locate(heard, found, chosen, truth, pose),
            "reference anchors": locate(heard, true_anchors, chosen, truth, None),
        }
    if out is not None:
        files = table_files(results["found anchors"])
        files["figure.png"] = _figure(heard, truth, results)
        replace_folder(out, files)
    _say(heard, results, out, as_json=as_json)


def _read(folder: Path) -> tuple[TagRecording, TagTruth | None]:
    from ..io.tag_recording import check_tag_recording
    from ..model.errors import SurveyFormatError

    check = check_tag_recording(folder)
    print_warnings(map(str, check.warnings))
    if check.recording is None:
        raise SurveyFormatError(check.faults)
    return check.recording, check.truth


def _places(path: Path, heard: TagRecording) -> tuple[dict[Any, Any], tuple[str, ...]]:
    from ..io.anchor_places import read_anchor_places
    from ..model.errors import SlamUwbError

    inside = path / "reference"
    found, left_out = read_anchor_places(inside if inside.is_dir() else path, heard.anchor_heights)
    if not found:
        why = f" ({'; '.join(left_out)})" if left_out else ""
        raise SlamUwbError(f"{path}: no anchor with a place to be trusted and a height{why}")
    return found, left_out


def _solution_with(anchors: Path) -> Solution | None:
    """The solution that a table of anchors is of; None where it is of one's own."""
    from ..io import read_solution

    folder = anchors if anchors.is_dir() else anchors.parent
    return read_solution(folder) if (folder / SOLUTION_FILE).is_file() else None


def _is_elsewhere(anchors: Path, truth: TagTruth | None) -> bool:
    """Whether the truth is in another frame than the anchors: what lay between them would be no errors."""
    solution = None if truth is None else _solution_with(anchors)
    if solution is None or solution.frame == "site":
        return False
    where = f"the anchors are in the frame of station {solution.frame}"
    print_warnings([f"truth.csv is not used: {where}; --reference DIR brings both together"])
    return True


def _frame(anchors: Path, found: dict[Any, Any], reference: Path) -> Pose2:
    """reference_T_anchors: as the solution is evaluated, where there is one, else on the anchors."""
    import numpy as np

    from ..evaluate import evaluate_solution, rigid_alignment
    from ..io import read_reference
    from ..model.errors import SlamUwbError

    truth, solution = read_reference(reference), _solution_with(anchors)
    if solution is not None:
        pose = evaluate_solution(solution, truth).reference_T_world
        if pose is not None:
            return pose
    both = [name for name in found if name in truth.anchors]
    try:
        return rigid_alignment(
            np.array([found[name][:2] for name in both]).reshape(-1, 2),
            np.array([(truth.anchors[n].x, truth.anchors[n].y) for n in both]).reshape(-1, 2),
        )
    except ValueError as error:
        raise SlamUwbError(
            f"{reference}: the anchors cannot be brought into its frame: {error}"
        ) from None


def _figure(heard: TagRecording, truth: TagTruth | None, results: dict[str, Positioned]) -> bytes:
    from ..report import draw_static_tags, draw_walk, figure_png

    if heard.stays:
        located = {method: item.placed for method, item in results.items()}
        places = {} if truth is None else truth.places
        return figure_png(draw_static_tags(heard.name, places, located))
    tracks = {method: item.path for method, item in results.items()}
    anchors = {method: item.anchors for method, item in results.items()}
    path = None if truth is None else truth.path
    return figure_png(draw_walk(heard.name, path, tracks, anchors=anchors))


def _say(
    heard: TagRecording, results: dict[str, Positioned], out: Path | None, *, as_json: bool
) -> None:
    summaries = {method: item.summary() for method, item in results.items()}
    if as_json:
        text = {"recording": heard.name, "out": None if out is None else str(out), **summaries}
        typer.echo(json.dumps(text, indent=2))
        return
    kind = f"{len(heard.stays)} static places" if heard.stays else "a moving tag"
    typer.echo(f"{heard.name}: {kind}, {len(heard.epochs)} epochs")
    for method, summary in summaries.items():
        line = f"{method + ':':<19}{summary['located']} of {summary['expected']} located"
        if summary["median_m"] is not None and math.isfinite(summary["median_m"]):
            line += f", error median {summary['median_m']:.2f} m, max {summary['max_m']:.2f} m"
        typer.echo(line)
    if out is not None:
        typer.echo(f"result  {out}")
