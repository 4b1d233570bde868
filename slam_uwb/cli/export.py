"""``slam-uwb export``: a solution in the formats of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import SolutionArgument, VerboseOption
from .solved_survey import read_solved_survey
from .summary import print_warnings
from .targets import replace_file

_FormatsOption = Annotated[
    list[str],
    typer.Option(
        metavar="FORMAT",
        show_default=False,
        help="What to write; may be given several times, or names separated by commas. Plans: dxf, "
        "geojson, svg, ros (map_server). Scans: ply, pcd. Graphs: g2o, pyfg, tum. Anchors for "
        "positioning systems: csv, json, dwm1001, bitcraze, pozyx.",
    ),
]
_FolderOption = Annotated[
    Path | None,
    typer.Option(
        "--folder",
        metavar="DIR",
        show_default="OUT-export beside OUT",
        help="Where to write; files of the same names are replaced.",
    ),
]


def export(
    out: SolutionArgument,
    to: _FormatsOption,
    folder: _FolderOption = None,
    _verbose: VerboseOption = False,
) -> None:
    """Write a solution for other tools: plans, clouds, anchors.

    Only anchors whose status is ok are handed to positioning systems. The survey's recordings are
    not needed.
    """
    from ..io.exporters import ANCHOR_EXPORTERS, export_solution
    from ..io.exporters.anchors import left_out

    solution = read_solved_survey(out)
    formats = [name for text in to for name in text.split(",") if name]
    files = export_solution(solution, formats)
    resolved = out.resolve()
    target = folder if folder is not None else resolved.with_name(f"{resolved.name}-export")
    target.mkdir(parents=True, exist_ok=True)
    missing = left_out(solution)
    if missing and ANCHOR_EXPORTERS.keys() & set(formats):
        print_warnings([f"anchors left out, since their places are not ok: {', '.join(missing)}"])
    for name, data in files.items():
        replace_file(target / name, data)
        typer.echo(target / name)
