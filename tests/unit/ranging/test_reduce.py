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
    assert link.distance == pytest.approx(5.0)
    assert link.mean == pytest.approx(6.0)
    assert (link.samples, link.discarded, link.rejection) == (3, 1, None)


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
    # The shorter path is believed, a quarter of the metre to the other one is uncertainty.
    (link,) = reduce_links(
        survey(ranges=(RangeSamples("s1", "A", [5.0, 6.0, 5.0, 6.0]),)), SETTINGS
    )

    assert (link.distance, link.samples, link.discarded) == (5.0, 2, 2)
    assert link.sigma == pytest.approx(math.hypot(0.10, 0.025 / math.sqrt(2.0), 0.25), abs=1e-6)


JITTER = 0.025 * np.random.default_rng(4).standard_normal(100)


def reduced(*parts):
    samples = np.concatenate([level + JITTER[:count] for level, count in parts])
    return reduce_links(survey(ranges=(RangeSamples("s1", "A", samples),)), SETTINGS)[0]


def test_of_two_paths_the_shorter_is_the_direct_one():
    # 40 samples by the direct path, 60 by a reflection 0.8 m longer: the median of all is 0.8 m off.
    link = reduced((5.0, 40), (5.8, 60))

    assert link.distance == pytest.approx(5.0, abs=0.02)
    assert (link.samples, link.discarded) == (40, 60)
    assert link.sigma > 0.2


def test_a_few_short_samples_are_no_path():
    link = reduced((5.0, 90), (4.2, 10))

    assert link.distance == pytest.approx(5.0, abs=0.02)
    assert link.sigma < 0.11


def test_a_peak_too_far_off_for_a_reflection_is_not_believed_for_being_short():
    # A third of the samples 12 m short: a fault of the device.
    link = reduced((20.0, 66), (8.0, 34))

    assert link.distance == pytest.approx(20.0, abs=0.02)
    assert link.sigma > 1.0


@pytest.mark.parametrize("share", [0.1, 0.3, 0.45])
def test_scattered_gross_samples_move_nothing(share):
    rng = np.random.default_rng(1)
    bad = rng.random(100) < share
    jumps = rng.uniform(1.5, 30.0, 100) * rng.choice([-1.0, 1.0], 100)

    samples = 31.0 + JITTER + np.where(bad, jumps, 0.0)
    (link,) = reduce_links(survey(ranges=(RangeSamples("s1", "A", samples),)), SETTINGS)

    assert link.distance == pytest.approx(31.0, abs=0.02)
    assert link.sigma < 0.11


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
