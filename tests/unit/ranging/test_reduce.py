from __future__ import annotations

import math

import numpy as np
import pytest

from slam_uwb.model.settings import RangingSettings
from slam_uwb.model.survey import (
    Anchor,
    AnchorRangeSamples,
    RangeSamples,
    Station,
    Survey,
    TwoWayPeriods,
)
from slam_uwb.ranging import reduce_anchor_links, reduce_links

SETTINGS = RangingSettings()
C = 299_792_458.0


def survey(**parts) -> Survey:
    stations = tuple(Station(name, None, 1.4) for name in ("s2", "s1"))
    anchors = tuple(Anchor(name, 2.5) for name in ("B", "A"))
    return Survey("test", stations, anchors, **parts)


def test_the_median_ignores_a_reflection_and_the_mean_does_not():
    links = reduce_links(
        survey(ranges=(RangeSamples("s1", "A", [5.0, 5.01, 4.99, 9.0]),)), SETTINGS
    )

    (link,) = links
    assert link.distance == pytest.approx(5.005)
    assert link.mean == pytest.approx(6.0)
    assert (link.samples, link.discarded, link.rejection) == (4, 0, None)


def test_absurd_samples_are_counted_and_not_used():
    samples = [-1.0, 0.0, math.nan, math.inf, -math.inf, 1000.1, 4.0]

    (link,) = reduce_links(survey(ranges=(RangeSamples("s1", "A", samples),)), SETTINGS)

    assert (link.samples, link.discarded) == (1, 6)
    assert link.distance == link.mean == 4.0


@pytest.mark.parametrize("samples", [[], [-3.0, math.nan]])
def test_a_link_without_a_usable_sample_stays_with_its_reason(samples):
    (link,) = reduce_links(survey(ranges=(RangeSamples("s1", "A", samples),)), SETTINGS)

    assert math.isnan(link.distance)
    assert math.isnan(link.mean)
    assert (link.samples, link.discarded) == (0, len(samples))
    assert link.rejection == f"no usable sample ({len(samples)} discarded)"


def test_many_samples_do_not_shrink_the_constant_error_of_a_link():
    one, many = (
        reduce_links(survey(ranges=(RangeSamples("s1", "A", [5.0] * n),)), SETTINGS)[0]
        for n in (1, 600)
    )

    # hypot(0.10, 0.025) and hypot(0.10, 0.025 / sqrt(600)).
    assert one.sigma == pytest.approx(0.103078, abs=1e-6)
    assert many.sigma == pytest.approx(0.100005, abs=1e-6)


def test_a_link_that_jumps_is_less_certain():
    # Median 5.5, all deviations 0.5: 1.4826 * 0.5 / sqrt(4) = 0.3707 beside the 0.10 of the link.
    (link,) = reduce_links(
        survey(ranges=(RangeSamples("s1", "A", [5.0, 6.0, 5.0, 6.0]),)), SETTINGS
    )

    assert link.sigma == pytest.approx(math.hypot(0.10, 0.37065), abs=1e-6)


def test_periods_win_over_ranges():
    flight, reply = 6.0 / C, 1e-3
    periods = [[reply + 2 * flight, reply, reply, reply + 2 * flight]]

    (link,) = reduce_links(
        survey(
            ranges=(RangeSamples("s1", "A", [3.0]),),
            periods=(TwoWayPeriods("s1", "A", periods),),
        ),
        SETTINGS,
    )

    assert link.distance == pytest.approx(6.0, abs=1e-6)


def test_the_formula_of_the_periods_is_a_setting():
    # Unequal replies (1 ms, 3 ms) and a tag clock 10 ppm fast: eq. 3 says -1.5 m, to 0.1 mm.
    flight = 6.0 / C
    periods = np.array([[1e-3 + 2 * flight, 1e-3, 3e-3, 3e-3 + 2 * flight]])
    periods *= 1.0 + np.array([1e-5, 0.0, 1e-5, 0.0])
    recorded = survey(periods=(TwoWayPeriods("s1", "A", periods),))

    (paper,) = reduce_links(recorded, RangingSettings(two_way="symmetric"))
    (default,) = reduce_links(recorded, SETTINGS)

    assert paper.distance == pytest.approx(6.0 - C * 2e-8 / 4, abs=1e-3)
    assert default.distance == pytest.approx(6.0, abs=1e-3)


def test_the_order_is_that_of_the_survey():
    pairs = [("s1", "A"), ("s2", "A"), ("s1", "B"), ("s2", "B")]
    ranges = tuple(RangeSamples(s, a, [5.0]) for s, a in pairs)

    links = reduce_links(survey(ranges=ranges), SETTINGS)

    assert [(link.station, link.anchor) for link in links] == [
        ("s2", "B"), ("s2", "A"), ("s1", "B"), ("s1", "A"),
    ]  # fmt: skip


def test_anchor_links_put_both_directions_together():
    ranges = (
        AnchorRangeSamples("A", "B", [7.0, 7.2]),
        AnchorRangeSamples("B", "A", [7.1, -1.0]),
    )

    (link,) = reduce_anchor_links(survey(anchor_ranges=ranges), SETTINGS)

    assert (link.anchor_a, link.anchor_b) == ("B", "A")
    assert link.distance == pytest.approx(7.1)
    assert link.sigma > 0.10


def test_an_anchor_link_without_a_usable_sample_is_none():
    ranges = (AnchorRangeSamples("A", "B", [math.nan]), AnchorRangeSamples("A", "A", [1.0]))

    assert reduce_anchor_links(survey(anchor_ranges=ranges), SETTINGS) == ()
