"""Exchanged ranges, asked of both links at once, with normal errors so that the answer is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from slam_uwb.graph.swaps import AnchorLinks, swap_gains

SIGMA = 0.1
TAGS = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [2.0, 1.0], [1.0, 3.0]])
ANCHORS = np.array([[5.0, 1.0], [-1.0, 2.0], [2.0, 6.0]])
OFFSETS = np.array([0.0, 0.3, -0.2])
RISES = np.full(len(TAGS), 1.2)


@dataclass(frozen=True)
class Normal:
    def costs(self, errors):
        return 0.5 * (errors / SIGMA) ** 2


def measured():
    """(A, N) m, exact, offsets included."""
    across = ANCHORS[:, None] - TAGS
    return np.sqrt((across**2).sum(axis=2) + RISES**2) + OFFSETS[:, None]


def gains(ranges, places=ANCHORS):
    numbers = np.arange(ranges.size).reshape(ranges.shape)
    anchors = [
        AnchorLinks(numbers[a], places[a], TAGS, RISES, ranges[a] - OFFSETS[a], OFFSETS[a])
        for a in range(len(ANCHORS))
    ]
    return swap_gains(anchors, lambda _rows: Normal())


def test_exact_ranges_never_fit_better_exchanged():
    found = gains(measured())
    assert len(found) == 3 * len(TAGS)
    assert max(found.values()) <= 1e-9


@pytest.mark.parametrize("station", range(len(TAGS)))
def test_exchanged_ranges_are_found_though_they_draw_their_anchors_away(station):
    ranges = measured()
    ranges[[0, 1], station] = ranges[[1, 0], station]
    # As a solution would have it: both places are off towards what fits.
    found = gains(ranges, ANCHORS + [[0.4, -0.3], [-0.5, 0.2], [0.0, 0.0]])
    pair = (station, len(TAGS) + station)
    assert max(found, key=found.__getitem__) == pair
    others = [gain for key, gain in found.items() if key != pair]
    assert found[pair] > 10.0
    assert max(others) < found[pair] / 2


def test_the_gain_is_what_normal_densities_give():
    # Errors e of the exchanged ranges where each place is known to S: e^2 / 2 (sigma^2 + S^2), of both links.
    ranges = measured()
    ranges[[0, 1], 4] = ranges[[1, 0], 4]
    expected = 0.0
    for a in (0, 1):
        directions = (ANCHORS[a] - TAGS) / (measured()[a] - OFFSETS[a])[:, None]
        rest = np.delete(directions, 4, axis=0)
        spread = directions[4] @ np.linalg.inv(rest.T @ rest / SIGMA**2) @ directions[4]
        error = ranges[a, 4] - measured()[a, 4]
        expected += 0.5 * error**2 / (SIGMA**2 + spread)
    assert gains(ranges)[4, len(TAGS) + 4] == pytest.approx(expected, rel=0.1)


def test_links_of_different_stations_are_not_compared():
    numbers = np.arange(2 * len(TAGS)).reshape(2, -1)
    elsewhere = TAGS + 0.5
    one, two = (
        AnchorLinks(numbers[a], ANCHORS[a], tags, RISES, measured()[a] - OFFSETS[a], OFFSETS[a])
        for a, tags in ((0, TAGS), (1, elsewhere))
    )
    assert swap_gains([one, two], lambda _rows: Normal()) == {}
