"""A picture of the floor that somebody drew: as darkness, bounded in size."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ..model.errors import Fault, SurveyFormatError
from ..model.geometry import Grid
from .files import read_file

_MAX_PIXELS = 80_000_000
"""A plan of A0 at 200 dots an inch has 60 million."""
_MAX_CELLS_A_SIDE = 1200
"""What a report shows and a solution keeps."""
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "GIF", "WEBP")


def read_picture(path: Path) -> tuple[Grid, float, tuple[int, int]]:
    """A picture as grey values.

    Returns:
        Darkness (H, W) 0-1 with row 0 at the bottom, at most 1200 cells a side; pixels a cell; width and
        height of the file in pixels.

    Raises:
        SurveyFormatError: it is missing, no picture, or has more pixels than any plan.
    """
    try:
        return _darkness(read_file(path).data)
    except OSError as error:
        problem = error.strerror or str(error)
    except (ValueError, SyntaxError) as error:
        problem = str(error)
    raise SurveyFormatError([Fault(str(path), problem)])


def _darkness(data: bytes) -> tuple[Grid, float, tuple[int, int]]:
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        picture = Image.open(io.BytesIO(data), formats=_FORMATS)
    except (UnidentifiedImageError, Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise ValueError(f"is no picture that can be read ({', '.join(_FORMATS)})") from None
    width, height = picture.size
    # Before anything is expanded: a small file may hold a huge picture.
    if width * height > _MAX_PIXELS:
        raise ValueError(f"has {width} x {height} pixels, the limit is {_MAX_PIXELS:,}")
    # As viewers show it, who were asked for the pixels.
    upright = ImageOps.exif_transpose(picture).convert("LA")
    width, height = upright.size
    pixels_a_cell = max(1.0, max(width, height) / _MAX_CELLS_A_SIDE)
    cells = (max(1, round(width / pixels_a_cell)), max(1, round(height / pixels_a_cell)))
    grey, opaque = np.moveaxis(
        np.asarray(upright.resize(cells, Image.Resampling.BOX)) / 255.0, 2, 0
    )
    # What is transparent is paper.
    return np.flipud((1.0 - grey) * opaque), pixels_a_cell, (width, height)
