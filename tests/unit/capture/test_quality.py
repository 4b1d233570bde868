import numpy as np
import pytest

from slam_uwb.capture.quality import RangeWatch, ScanWatch
from slam_uwb.capture.samples import LidarSamples, RangeEpoch, RangeReading, Tally


def chunk(number, starts, returns=None):
    ranges = np.ones(number) if returns is None else returns
    return LidarSamples(np.zeros(number), ranges, np.ones(number), np.array(starts, dtype=np.int64))


def test_points_and_rate_over_chunks():
    # 500 Hz, a start every 250 samples, in chunks of 100: 2 Hz.
    watch = ScanWatch()
    for k in range(25):
        first = 100 * k
        starts = [s - first for s in range(0, 2500, 250) if first <= s < first + 100]
        watch.add(chunk(100, starts), (first + np.arange(100)) / 500, Tally(700, 100))
    now = watch.now()
    assert now.samples == now.returns == 2500
    assert now.revolutions == 9
    assert now.points == 250
    assert now.rotation_hz == pytest.approx(2.0)
    assert now.uneven == 0
    assert now.tally == Tally(17500, 2500)


def test_a_revolution_with_missing_points_is_uneven():
    watch = ScanWatch()
    starts = [0, 100, 200, 280, 380]
    watch.add(chunk(400, starts), np.arange(400) / 200, Tally())
    assert watch.now().uneven == 1


def test_returns():
    watch = ScanWatch()
    watch.add(chunk(3, [], np.array([1.0, np.nan, 2.0])), np.arange(3.0), Tally())
    assert watch.now().returns == 2


def test_median_and_spread_of_an_anchor():
    # Deviations from 2.0: 0.1, 0, 0.1, 1, so the median of them is 0.1.
    watch = RangeWatch()
    for distance in (1.9, 2.0, 2.1, 3.0, 2.0):
        watch.add([RangeEpoch((RangeReading("A1", distance),))], Tally())
    watch.add([RangeEpoch((RangeReading("A1", float("nan"), quality="RX_TIMEOUT"),))], Tally())
    (anchor,) = watch.now()
    assert (anchor.count, anchor.failed, anchor.median) == (5, 1, 2.0)
    assert anchor.spread == pytest.approx(1.4826 * 0.1)


def test_memory_is_bounded():
    watch = RangeWatch()
    for k in range(2000):
        watch.add([RangeEpoch((RangeReading(f"{k:04X}", 1.0),))], Tally())
    assert len(watch.now()) == 500
    for _ in range(2000):
        watch.add([RangeEpoch((RangeReading("0000", 2.0),))], Tally())
    assert watch.now()[0].count == 2001
    assert watch.now()[0].median == 2.0
