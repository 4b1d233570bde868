"""Floor map <-> bytes: one byte a cell, and the picture that the ROS map_server reads."""

from __future__ import annotations

import base64
import io
import zlib

import numpy as np
from numpy.typing import NDArray

from ..model.floor import FloorMap
from ..model.geometry import Grid

OCCUPIED_THRESHOLD = 0.65
FREE_THRESHOLD = 0.196
"""The map_server's own defaults: the grey of unknown, 205, is 0.19608 and just not free."""
MAX_CELLS = 100_000_000
_UNKNOWN = 255
_STEPS = 254


def quantise(occupancy: Grid) -> NDArray[np.uint8]:
    """(H, W) bytes: 0-254 for 0-1, 255 for NaN."""
    steps = np.rint(np.clip(np.nan_to_num(occupancy), 0.0, 1.0) * _STEPS)
    return np.where(np.isnan(occupancy), _UNKNOWN, steps).astype(np.uint8)


def occupancy_of(cells: NDArray[np.uint8]) -> Grid:
    """(H, W) probabilities, NaN where never seen; within 0.002 of what was quantised."""
    return np.where(cells == _UNKNOWN, np.nan, cells / _STEPS)


def pack(cells: NDArray[np.uint8]) -> str:
    """Text of the bytes, row 0 first: zlib, then base64."""
    return base64.b64encode(zlib.compress(cells.tobytes(), 9)).decode("ascii")


def unpack(text: str, height: int, width: int) -> NDArray[np.uint8]:
    """(height, width) bytes of a text; ValueError where it does not hold exactly these."""
    count = height * width
    if count > MAX_CELLS:
        raise ValueError(f"{count:,} cells, the limit is {MAX_CELLS:,}")
    try:
        stream = zlib.decompressobj()
        # Bounded: never more than one byte beyond what is expected is expanded.
        data = stream.decompress(base64.b64decode(text, validate=True), count + 1)
    except (ValueError, zlib.error) as error:
        raise ValueError(f"no zlib data in base64: {error}") from None
    if len(data) != count:
        raise ValueError(f"does not hold the {count:,} cells of a {height} x {width} map")
    return np.frombuffer(data, dtype=np.uint8).reshape(height, width)


def ros_map(floor_map: FloorMap) -> tuple[bytes, bytes]:
    """map.png (8-bit grey, row 0 at the largest y) and map.yaml of the ROS map_server."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(_grey(floor_map)).save(stream, format="PNG", optimize=False)
    return stream.getvalue(), _yaml(floor_map, "map.png")


def pgm_map(floor_map: FloorMap) -> tuple[bytes, bytes]:
    """map.pgm (binary, 8-bit) and map.yaml: the map_server's first format."""
    grey = _grey(floor_map)
    header = f"P5\n{grey.shape[1]} {grey.shape[0]}\n255\n"
    return header.encode() + grey.tobytes(), _yaml(floor_map, "map.pgm")


def _grey(floor_map: FloorMap) -> NDArray[np.uint8]:
    # From the stored steps, so that a solution read and written again gives the same picture.
    occupancy = occupancy_of(quantise(floor_map.occupancy))
    grey = np.full(occupancy.shape, 205, dtype=np.uint8)
    grey[occupancy > OCCUPIED_THRESHOLD] = 0
    grey[occupancy < FREE_THRESHOLD] = 254
    return np.flipud(grey)


def _yaml(floor_map: FloorMap, picture: str) -> bytes:
    x, y = floor_map.origin
    return (
        f"image: {picture}\n"
        f"resolution: {floor_map.resolution:.6f}\n"
        f"origin: [{x + 0.0:.6f}, {y + 0.0:.6f}, 0.000000]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESHOLD}\n"
        f"free_thresh: {FREE_THRESHOLD}\n"
    ).encode()
