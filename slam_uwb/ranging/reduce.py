"""All range samples of one link -> one measurement.

The error of a link is a constant of the link, not of its samples: averaging does not shrink it.
So a link is one measurement, whose sigma hardly depends on how often it was taken.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.geometry import FloatArray
from ..model.products import AnchorLink, LinkMeasurement
from ..model.settings import RangingSettings
from ..model.survey import AnchorId, StationId, Survey
from .two_way import asymmetric_distances, symmetric_distances

TWO_WAY = {"asymmetric": asymmetric_distances, "symmetric": symmetric_distances}

MAD_TO_SIGMA = 1.4826
"""Median absolute deviation to standard deviation of a normal distribution."""
RIVAL_SHARE = 0.25
"""Of the distance to a rival path, as standard deviation: the wrong one may have been believed."""


def reduce_links(survey: Survey, settings: RangingSettings) -> tuple[LinkMeasurement, ...]:
    """One measurement a link, in the survey's order of stations, then of anchors.

    A link with two-way-ranging periods is taken from them, whatever `ranges` has. A link without a
    usable sample stays, with a NaN distance and its reason.

    Args:
        survey: what was measured; links of stations or anchors that it does not list are ignored.
        settings: limits and noise.

    Returns:
        `distance` is the median of the samples of one path (`main_path`), `mean` the plain average of
        all usable ones (paper, IV), `sigma` the link's constant error with what jitter leaves after
        averaging, and more where several paths were heard.
    """
    samples = {(entry.station, entry.anchor): entry.distances for entry in survey.ranges}
    to_distances = TWO_WAY[settings.two_way]
    samples |= {
        (entry.station, entry.anchor): to_distances(entry.periods) for entry in survey.periods
    }
    return tuple(
        _reduce_link(station.id, anchor.id, samples[station.id, anchor.id], settings)
        for station in survey.stations
        for anchor in survey.anchors
        if (station.id, anchor.id) in samples
    )


def reduce_anchor_links(survey: Survey, settings: RangingSettings) -> tuple[AnchorLink, ...]:
    """One measurement a pair of anchors that has a usable sample, in the survey's order of anchors.

    Samples of (a, b) and (b, a) measure the same distance and are put together.
    """
    order = {anchor.id: index for index, anchor in enumerate(survey.anchors)}
    groups: dict[tuple[AnchorId, AnchorId], list[FloatArray]] = {}
    for entry in survey.anchor_ranges:
        pair = (entry.anchor_a, entry.anchor_b)
        if pair[0] == pair[1] or not all(end in order for end in pair):
            continue
        groups.setdefault(pair if order[pair[0]] < order[pair[1]] else pair[::-1], []).append(
            entry.distances
        )
    reduced = []
    for a, b in sorted(groups, key=lambda pair: (order[pair[0]], order[pair[1]])):
        usable = _usable(np.concatenate(groups[a, b]), settings)
        if usable.size:
            reduced.append(AnchorLink(a, b, float(np.median(usable)), _sigma(usable, settings)))
    return tuple(reduced)


def _reduce_link(
    station: StationId, anchor: AnchorId, distances: FloatArray, settings: RangingSettings
) -> LinkMeasurement:
    usable = _usable(distances, settings)
    discarded = len(distances) - len(usable)
    if not usable.size:
        nothing = float("nan")
        reason = f"no usable sample ({discarded} discarded)"
        return LinkMeasurement(
            station, anchor, nothing, nothing, nothing, 0, discarded, rejection=reason
        )
    path, rival = main_path(usable, settings)
    return LinkMeasurement(
        station=station,
        anchor=anchor,
        distance=float(np.median(path)),
        mean=float(np.mean(usable)),
        sigma=math.hypot(_sigma(path, settings), RIVAL_SHARE * rival),
        samples=len(path),
        discarded=discarded + len(usable) - len(path),
    )


def main_path(usable: FloatArray, settings: RangingSettings) -> tuple[FloatArray, float]:
    """The samples of the path that is believed, and how far off (m) the nearest rival is, 0 without one.

    Samples further apart than `path_gap_m` belong to different paths. Of those with a fair share of
    the samples the shortest is the direct one, if the others can be reflections: a few metres longer
    at most. Else the one with most samples is believed.
    """
    ordered = np.sort(usable)
    paths = np.split(ordered, np.nonzero(np.diff(ordered) > settings.path_gap_m)[0] + 1)
    least = max(settings.path_share * len(ordered), min(2, len(ordered)))
    fair = [p for p in paths if len(p) >= least]
    if not fair:
        return ordered, float(np.ptp(ordered))
    main = max(fair, key=len)
    nearer = [p for p in fair if 0.0 <= np.median(main) - np.median(p) <= settings.max_reflection_m]
    main = nearer[0]
    rivals = [abs(float(np.median(p) - np.median(main))) for p in fair if p is not main]
    return main, min(rivals, default=0.0)


def _usable(distances: FloatArray, settings: RangingSettings) -> FloatArray:
    """The samples that can be distances; zero is what devices write for "no answer"."""
    # NaN compares false, so it is discarded without a warning.
    return distances[(distances > 0.0) & (distances <= settings.max_range_m)]


def _sigma(usable: FloatArray, settings: RangingSettings) -> float:
    """Standard deviation of the reduced distance, m."""
    # The observed spread counts where it exceeds the expected one: a link that jumps between paths.
    spread = MAD_TO_SIGMA * float(np.median(np.abs(usable - np.median(usable))))
    jitter = max(settings.sample_sigma_m, spread)
    return math.hypot(settings.link_sigma_m, jitter / math.sqrt(len(usable)))
