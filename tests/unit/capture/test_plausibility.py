from dataclasses import replace

from slam_uwb.capture.plausibility import doubts_of_ranges, doubts_of_scan
from slam_uwb.capture.quality import RangeWatch, ScanQuality
from slam_uwb.capture.samples import RangeEpoch, RangeReading, Tally

GOOD = ScanQuality(30_000, 29_000, 120, 250.0, 2.02, 3, Tally(210_000, 30_000, {"lost sync": 5}))


def test_a_good_recording_raises_no_doubt():
    assert list(doubts_of_scan(GOOD, 2.0)) == []


def test_each_doubt():
    for changes, told in (
        ({"returns": 0}, "covered"),
        ({"rotation_hz": 1.7}, "1.70 Hz instead of 2 Hz"),
        ({"uneven": 13}, "13 of 120"),
        ({"tally": Tally(210_000, 29_000, {"bytes outside frames": 300})}, "300 of 210000"),
    ):
        (doubt,) = doubts_of_scan(replace(GOOD, **changes), 2.0)
        assert told in doubt


def test_ranges():
    watch = RangeWatch()
    assert list(doubts_of_ranges(watch)) == ["no anchor was heard"]
    heard = [RangeEpoch((RangeReading("A1", 1.0),))]
    watch.add(heard, Tally(100, 100, {"garbled lines": 1}))
    assert list(doubts_of_ranges(watch)) == []
    watch.add(heard, Tally(0, 0, {"garbled lines": 1}))
    assert list(doubts_of_ranges(watch)) == ["2 lines of the tag were garbled"]
