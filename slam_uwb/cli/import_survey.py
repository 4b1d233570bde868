"""``slam-uwb import``: recordings of other programs to a survey folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import NewSurveyOption, VerboseOption
from .summary import print_warnings
from .targets import refuse_survey_target

if TYPE_CHECKING:
    from ..capture.samples import RangeEpoch
    from ..io.importers.ranges import ParseLine
    from ..model.survey import Survey


_FormatArgument = Annotated[
    str,
    typer.Argument(
        metavar="FORMAT",
        show_default=False,
        help="sweep-csv, frame-grabber, csv, carmen, bag, cloud; dwm1001-log, trek1000-log, "
        "ranges-csv.",
    ),
]
_FilesArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILES", show_default=False, help="One a station, named as the station."
    ),
]
_RangesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--ranges",
        metavar="FORMAT:FILE",
        show_default=False,
        help="UWB distances of the station named as the file; may be repeated.",
    ),
]
_HeightsOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", show_default=False, help="CSV `anchor,height_m` of the anchors."),
]
_TagHeightOption = Annotated[
    float | None,
    typer.Option(metavar="M", show_default=False, help="Needed where there are ranges."),
]
_TagOption = Annotated[
    str | None,
    typer.Option(
        metavar="TAG", show_default=False, help="Which tag of a log that holds several (trek1000)."
    ),
]
_MaxRangeOption = Annotated[
    float, typer.Option(min=1.0, max=1000.0, metavar="M", help="Longer returns are none.")
]
_BandOption = Annotated[
    tuple[float, float],
    typer.Option(metavar="LOW HIGH", help="Slice of a cloud, z about the scanner."),
]
_SpacingOption = Annotated[
    float,
    typer.Option(min=0.1, max=100.0, metavar="M", help="Between stations of a robot's log."),
]
_MergeOption = Annotated[
    float,
    typer.Option(
        min=0.0, max=10.0, metavar="M", help="A robot's scans so near a station are merged."
    ),
]


def import_recordings(
    form: _FormatArgument,
    files: _FilesArgument,
    out: NewSurveyOption,
    ranges: _RangesOption = None,
    heights: _HeightsOption = None,
    tag_height_m: _TagHeightOption = None,
    tag: _TagOption = None,
    max_range_m: _MaxRangeOption = 40.0,
    band_m: _BandOption = (-0.1, 0.1),
    spacing_m: _SpacingOption = 2.0,
    merge_m: _MergeOption = 0.3,
    _verbose: VerboseOption = False,
) -> None:
    """Make a survey folder of recordings that you have already.

    The poses of a robot's log go to reference/stations.csv: to evaluate by, no solver reads them.
    """
    from ..io import check_height, write_survey
    from ..io.importers import ImportOptions, import_survey

    refuse_survey_target(out)
    known = {} if heights is None else _heights(heights)
    if tag_height_m is not None:
        with _told_of("--tag-height-m"):
            check_height(tag_height_m)
    options = ImportOptions(
        name=out.resolve().name,
        max_range=max_range_m,
        band=(min(band_m), max(band_m)),
        spacing=spacing_m,
        merge=merge_m,
        tag_height=tag_height_m,
        tag=tag,
        heights=known,
        parsers=line_parsers(),
    )
    further = [_named_file(item) for item in ranges or ()]
    survey, reference = import_survey(form, files, further, options)
    write_survey(survey, out, reference=reference, lidar_model=f"imported: {form}")
    unheard = [name for name in known if name not in {str(a.id) for a in survey.anchors}]
    if unheard:
        print_warnings([f"--heights {heights}: no range is of {', '.join(unheard)}"])
    _say(survey, out)


def _say(survey: Survey, out: Path) -> None:
    typer.echo(f"{len(survey.stations)} stations, {len(survey.anchors)} anchors, in {out}")
    unmeasured = [str(anchor.id) for anchor in survey.anchors if anchor.height is None]
    if unmeasured:
        typer.echo(
            "measure their heights and write them into survey.toml (or import with --heights): "
            f"{', '.join(unmeasured)}"
        )


def _heights(file: Path) -> dict[str, float]:
    """M above the floor by anchor; SlamUwbError where one cannot be in metres."""
    from ..io import check_height
    from ..io.importers.ranges import read_heights
    from ..io.importers.source import read_source

    found = read_heights(read_source(file))
    for anchor, height in found.items():
        with _told_of(f"--heights {file}: anchor {anchor}"):
            check_height(height)
    return found


@contextmanager
def _told_of(what: str) -> Iterator[None]:
    """Errors inside begin with what they are about."""
    from ..model.errors import SlamUwbError

    try:
        yield
    except SlamUwbError as error:
        raise SlamUwbError(f"{what}: {error}") from None


def _named_file(item: str) -> tuple[str, Path]:
    form, separator, path = item.partition(":")
    if not separator or not path:
        raise typer.BadParameter(f"{item!r}: expected FORMAT:FILE", param_hint="--ranges")
    return form, Path(path)


def line_parsers() -> dict[str, ParseLine]:
    """What reads a line of a device's log, by format: `io` knows no devices."""
    from ..capture.frames import dwm1001, trek1000

    return {
        "dwm1001-log": _readings(dwm1001.find_report),
        "trek1000-log": _readings(trek1000.find_report),
    }


def _readings(find: Callable[[str], RangeEpoch | None]) -> ParseLine:
    def read(line: str) -> tuple[str | None, Sequence[tuple[str, float]]] | None:
        epoch = find(line)
        if epoch is None:
            return None
        return epoch.tag, [(r.anchor, r.distance) for r in epoch.readings if r.other is None]

    return read
