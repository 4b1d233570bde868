"""``slam-uwb import``: recordings of other programs to a survey folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import VerboseOption
from .targets import refuse_survey_target

if TYPE_CHECKING:
    from ..capture.samples import RangeEpoch


def import_recordings(
    form: Annotated[
        str,
        typer.Argument(
            metavar="FORMAT",
            show_default=False,
            help="sweep-csv, frame-grabber, csv, carmen, bag, cloud; dwm1001-log, trek1000-log, "
            "ranges-csv.",
        ),
    ],
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILES", show_default=False, help="One a station, named as the station."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            metavar="SURVEY", show_default=False, help="Survey folder to write: a new one."
        ),
    ],
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--ranges",
            metavar="FORMAT:FILE",
            show_default=False,
            help="UWB distances of the station named as the file; may be repeated.",
        ),
    ] = None,
    heights: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default=False, help="CSV `anchor,height_m` of the anchors."
        ),
    ] = None,
    tag_height_m: Annotated[
        float | None,
        typer.Option(metavar="M", show_default=False, help="Needed where there are ranges."),
    ] = None,
    max_range_m: Annotated[
        float, typer.Option(min=1.0, max=1000.0, metavar="M", help="Longer returns are none.")
    ] = 40.0,
    band_m: Annotated[
        tuple[float, float],
        typer.Option(metavar="LOW HIGH", help="Slice of a cloud, z about the scanner."),
    ] = (-0.1, 0.1),
    spacing_m: Annotated[
        float,
        typer.Option(min=0.1, max=100.0, metavar="M", help="Between stations of a robot's log."),
    ] = 2.0,
    merge_m: Annotated[
        float,
        typer.Option(
            min=0.0, max=10.0, metavar="M", help="A robot's scans so near a station are merged."
        ),
    ] = 0.3,
    _verbose: VerboseOption = False,
) -> None:
    """Make a survey folder of recordings that you have already.

    The poses of a robot's log go to reference/stations.csv: to evaluate by, no solver reads them.
    """
    from ..capture.frames import dwm1001, trek1000
    from ..io import check_height, write_survey
    from ..io.importers import ImportOptions, import_survey
    from ..io.importers.ranges import read_heights
    from ..io.importers.source import read_source

    refuse_survey_target(out)
    known = {} if heights is None else read_heights(read_source(heights))
    for height in (*known.values(), *([] if tag_height_m is None else [tag_height_m])):
        check_height(height)
    options = ImportOptions(
        name=out.resolve().name,
        max_range=max_range_m,
        band=(min(band_m), max(band_m)),
        spacing=spacing_m,
        merge=merge_m,
        tag_height=tag_height_m,
        heights=known,
        parsers={
            "dwm1001-log": _readings(dwm1001.find_report),
            "trek1000-log": _readings(trek1000.find_report),
        },
    )
    further = [_named_file(item) for item in ranges or ()]
    survey, reference = import_survey(form, files, further, options)
    write_survey(survey, out, reference=reference, lidar_model=f"imported: {form}")
    typer.echo(f"{len(survey.stations)} stations, {len(survey.anchors)} anchors, in {out}")
    unmeasured = [str(anchor.id) for anchor in survey.anchors if anchor.height is None]
    if unmeasured:
        typer.echo(
            f"measure their heights and write them into survey.toml: {', '.join(unmeasured)}"
        )


def _named_file(item: str) -> tuple[str, Path]:
    form, separator, path = item.partition(":")
    if not separator or not path:
        raise typer.BadParameter(f"{item!r}: expected FORMAT:FILE", param_hint="--ranges")
    return form, Path(path)


def _readings(
    find: Callable[[str], RangeEpoch | None],
) -> Callable[[str], Sequence[tuple[str, float]] | None]:
    def read(line: str) -> Sequence[tuple[str, float]] | None:
        epoch = find(line)
        if epoch is None:
            return None
        return [(r.anchor, r.distance) for r in epoch.readings if r.other is None]

    return read
