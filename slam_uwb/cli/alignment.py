"""The option ``--align``: which frame the results are given in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..model.frame_change import Alignment, DrawnPlan

AlignOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="walls|ID=X,Y|PICTURE",
        show_default=False,
        help="Frame of all results: `walls` turns the main walls along the axes; two or more "
        "stations or anchors with their places in metres (A1=0.1,7.5) move it there. With the "
        "picture of a floor plan (plan.png) the numbers are pixels of it, column and row from its "
        "upper left corner: x is then along its width from its lower left corner, in metres.",
    ),
]
_EXPECTED = "expected `walls`, or ID=X,Y in metres, or a picture and ID=COLUMN,ROW in its pixels"

Points = dict[str, tuple[float, float]]


def parse_alignment(words: Sequence[str]) -> Alignment | None:
    """`walls`, places by identifier, or a picture with pixels by identifier; SettingsError for anything else."""
    from ..model.errors import SettingsError

    if list(words) in ([], ["walls"]):
        return words[0] if words else None
    pictures = [word for word in words if Path(word).is_file()]
    points = dict(_point(word) for word in words if word not in pictures)
    if len(pictures) > 1:
        raise SettingsError("--align", f"{', '.join(pictures)}: one picture at most")
    return _drawn(Path(pictures[0]), points) if pictures else points


def _point(word: str) -> tuple[str, tuple[float, float]]:
    from ..model.errors import SettingsError

    name, _, place = word.rpartition("=")
    try:
        x, y = map(float, place.split(","))
    except ValueError:
        x = y = math.nan
    if not name or not math.isfinite(x + y):
        raise SettingsError("--align", f"{word!r}: {_EXPECTED}")
    return name, (x, y)


def _drawn(path: Path, points: Points) -> DrawnPlan:
    """The picture with its points, which must lie in it."""
    from ..io import read_picture
    from ..model.errors import SettingsError
    from ..model.frame_change import DrawnPlan

    darkness, pixels_a_cell, (width, height) = read_picture(path)
    for name, (column, row) in points.items():
        if not (0.0 <= column <= width and 0.0 <= row <= height):
            raise SettingsError(
                "--align",
                f"{name}={column:g},{row:g} is not in the picture of {width} x {height} pixels",
            )
    return DrawnPlan(darkness, pixels_a_cell, float(height), points)
