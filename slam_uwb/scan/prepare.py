"""Reduce a recording to one point an angle bin and describe the points (paper, III.A, Algorithm 1, lines 2-4)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.geometry import FloatArray, Points
from ..model.products import PreparedScan
from ..model.settings import ScanSettings
from ..model.survey import Scan, StationId
from .landmarks import extract_landmarks
from .lines import extract_segments, segment_noise, straight_parts

_ON_EDGE = 1e-9  # bins
_SURFACE_GAP_M = 0.1  # samples of a bin further apart in range than this are of two surfaces


def reduce_scan(scan: Scan, settings: ScanSettings) -> Scan:
    """One sample an angle bin: the returns near the median of its ranges, averaged in the plan.

    A bin in which fewer than `min_return_share` of the samples came back is no return (its range is
    NaN; without any return its bearing is the mean of its samples'). Bins without any sample are
    absent. Where the middle of a bin falls between two surfaces the nearer is taken: a mean would
    be a point where nothing is.

    Returns:
        A scan ordered by bearing in [-pi, pi).
    """
    width = math.radians(settings.bin_deg)
    # Encoders count in fractions of a degree: many bearings lie on an edge, and rounding must not
    # choose their side.
    edge = _ON_EDGE * width
    bearings = np.remainder(scan.bearings + (math.pi + edge), 2.0 * math.pi) - (math.pi + edge)
    bins = ((bearings + (math.pi + edge)) / width).astype(np.int64)
    returned = (scan.ranges > 0.0) & (scan.ranges <= scan.max_range)
    samples = np.bincount(bins)
    count, used = len(samples), np.flatnonzero(samples)
    returns = np.bincount(bins[returned], minlength=count)

    middles = (np.arange(count) + 0.5) * width - math.pi
    offsets = bearings - middles[bins]
    # Bearings from the middle of their bin have no seam.
    x, y = _typical_points(scan.ranges[returned], offsets[returned], bins[returned], returns)
    mean_offset = np.bincount(bins, offsets) / np.maximum(samples, 1)
    offset = np.where(returns > 0, np.arctan2(y, x), mean_offset).astype(np.float64)
    seen = (returns > 0) & (returns >= settings.min_return_share * samples)
    ranges = np.where(seen, np.hypot(x, y), np.nan)
    return Scan((middles + offset)[used], ranges[used], scan.max_range)


def _typical_points(
    ranges: FloatArray, offsets: FloatArray, bins: NDArray[np.int64], returns: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """X and y (B,) of the mean point of each bin with `returns` (B,) samples, x along its middle.

    Averaged are the samples of the middle half by range that lie on the surface of the median. Each
    keeps its own bearing, so that the mean of points of a straight wall is a point of the wall,
    however grazing the rays: the median of the bearings is that of another sample.
    """
    # Ranges come in steps of a centimetre: bearings settle ties, or the order of the samples would.
    order = np.lexsort((offsets, ranges, bins))
    ranges, offsets, bins = ranges[order], offsets[order], bins[order]
    first = np.cumsum(returns) - returns
    rank = np.arange(len(ranges)) - first[bins]
    trimmed = (returns + 1) // 4  # at either end; of three samples one, of two none
    lower_median = ranges[(first + np.maximum(returns - 1, 0) // 2)[bins]]
    middle = (rank >= trimmed[bins]) & (rank < (returns - trimmed)[bins])
    middle &= np.abs(ranges - lower_median) <= _SURFACE_GAP_M
    ranges, offsets, bins = ranges[middle], offsets[middle], bins[middle]
    kept = np.maximum(np.bincount(bins, minlength=len(returns)), 1)
    x = np.bincount(bins, ranges * np.cos(offsets), len(returns)) / kept
    y = np.bincount(bins, ranges * np.sin(offsets), len(returns)) / kept
    return x, y


def prepare_scan(
    station: StationId, scan: Scan, settings: ScanSettings, *, landmarks: bool = True
) -> PreparedScan:
    """Points, normals, wall segments, landmarks and free space of one recording, in the scanner's frame.

    Args:
        station: Where it was taken.
        scan: Raw recording, or one that `reduce_scan` already reduced (reducing twice changes
            nothing).
        settings: Bins, gaps and lengths.
        landmarks: Whether anything will ask for them; if not, there are none.
    """
    reduced = reduce_scan(scan, settings)
    seen = ~np.isnan(reduced.ranges)
    bearings, ranges = reduced.bearings[seen], reduced.ranges[seen]
    points = ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    bin_width = math.radians(settings.bin_deg)
    gaps = np.maximum(settings.neighbour_gap_m, 3.0 * ranges * bin_width)
    parts = straight_parts(points, gaps, settings)
    segments, members = extract_segments(points, parts, settings)
    noise = segment_noise(points, segments, members)
    normals, variance = _normals(points, ranges, parts, noise, settings)
    return PreparedScan(
        station=station,
        points=points,
        normals=normals,
        normal_variance=variance,
        lengths=_arc_lengths(points, settings.max_point_length_m),
        on_wall=np.isin(np.arange(len(points)), np.concatenate([[-1], *members])),
        segments=segments,
        landmarks=extract_landmarks(segments if landmarks else segments[:0], settings),
        free_ranges=_free_ranges(bearings, ranges, settings),
        noise=noise,
    )


def _normals(
    points: Points,
    ranges: FloatArray,
    parts: list[np.ndarray],
    noise: float,
    settings: ScanSettings,
) -> tuple[Points, FloatArray]:
    """Unit normals towards the scanner (N, 2) and the variance of the wall's slope (N,), by local PCA.

    The variance is that of library practice for total least squares: residual variance over the
    spread along the wall. Neighbours are those of the same straight part: round a corner they would
    bend the normal, and the jambs of a door, which alone hold two rooms together, would have none.
    Points far from the scanner are sparse, so their neighbourhood grows with the distance of the
    bins.
    """
    count = len(points)
    if count == 0:
        return np.zeros((0, 2)), np.zeros(0)
    radius = np.maximum(settings.normal_radius_m, 2.5 * ranges * math.radians(settings.bin_deg))
    k, xx, yy, xy = _scatters(points, radius, parts)
    # Closed-form eigenvalues of the 2 x 2 scatter; the normal belongs to the smaller.
    half_gap = np.hypot(0.5 * (xx - yy), xy)
    large = 0.5 * (xx + yy) + half_gap
    small = np.maximum(0.5 * (xx + yy) - half_gap, 0.0)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    normals *= np.where(np.einsum("ij,ij->i", normals, points) > 0.0, -1.0, 1.0)[:, None]
    enough = (k >= 3) & (large > 0.0)
    variance = np.full(count, np.inf)
    variance[enough] = np.maximum(small[enough] / (k[enough] - 2.0), noise**2) / large[enough]
    normals[~enough] = 0.0
    return normals, variance


def _scatters(
    points: Points, radius: FloatArray, parts: list[np.ndarray]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(N,) each: number of the points near a point on its part, itself included, and their scatter xx, yy, xy."""
    offsets = points[None, :, :] - points[:, None, :]
    part_of = np.full(len(points), -1)
    for index, part in enumerate(parts):
        part_of[part] = index
    same = part_of[:, None] == part_of[None, :]
    close = np.einsum("ijk,ijk->ij", offsets, offsets) <= (radius**2)[:, None]
    near = (close & same).astype(np.float64)
    k = near.sum(axis=1)
    x, y = offsets[:, :, 0], offsets[:, :, 1]
    mean_x, mean_y = np.einsum("ijk,ij->ki", offsets, near) / k
    xx = np.einsum("ij,ij->i", near, x**2) - k * mean_x**2
    yy = np.einsum("ij,ij->i", near, y**2) - k * mean_y**2
    xy = np.einsum("ij,ij->i", near, x * y) - k * mean_x * mean_y
    return k, xx, yy, xy


def _arc_lengths(points: Points, cap: float) -> FloatArray:
    """(N,) metres of wall a point stands for: half the gaps to its neighbours in bearing order, each capped."""
    if len(points) < 2:
        return np.full(len(points), cap)
    gaps = np.minimum(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1), cap)
    return np.asarray(0.5 * (gaps + np.roll(gaps, 1)))


def _free_ranges(bearings: FloatArray, ranges: FloatArray, settings: ScanSettings) -> FloatArray:
    """(B,) metres that were looked through in each sector: the nearest return of the sector and its neighbours."""
    count = round(360.0 / settings.bin_deg)
    sector = np.minimum(
        ((bearings + math.pi) / (2.0 * math.pi) * count).astype(np.int64), count - 1
    )
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, sector, ranges)
    around = np.minimum(np.minimum(nearest, np.roll(nearest, 1)), np.roll(nearest, -1))
    # A sector without a return is unknown (glass, black, too far), whatever its neighbours say.
    return np.where(np.isfinite(nearest), around, 0.0)
