from itertools import combinations

import numpy as np
import pytest

from slam_uwb.matching import candidate_pairs, index_scans, match_pairs
from slam_uwb.matching.hypotheses import match_pair
from slam_uwb.model.errors import SettingsError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.processes import sharing
from slam_uwb.scan import prepare_scan

STATIONS = ("s1", "s2", "s3")


@pytest.fixture
def sequence_only(settings):
    return settings.model_copy(update={"pairs": "sequence"})


def numbers(matches):
    """Everything of the matches as plain values."""
    return [
        (m.target, m.source, m.rank, m.degenerate, m.rejection, m.overlap, m.violation, m.score,
         *m.target_T_source.vector, *m.covariance.ravel())
        for m in matches
    ]  # fmt: skip


def test_all_takes_every_pair_once_in_the_surveys_order(settings):
    expected = (("s1", "s2"), ("s1", "s3"), ("s2", "s3"))
    assert candidate_pairs(STATIONS, None, settings) == expected
    assert candidate_pairs(STATIONS, (), settings) == expected


def test_the_sequence_says_which_scan_is_fitted_to_which(settings):
    sequence = (("s3", "s1"), ("s2", "s3"))
    assert candidate_pairs(STATIONS, sequence, settings) == (
        ("s1", "s2"), ("s3", "s1"), ("s2", "s3"),
    )  # fmt: skip


def test_sequence_takes_its_pairs_alone_in_its_order(sequence_only):
    sequence = (("s3", "s1"), ("s2", "s3"))
    assert candidate_pairs(STATIONS, sequence, sequence_only) == sequence


def test_stations_without_a_scan_are_in_no_pair(settings, sequence_only):
    sequence = (("s1", "s9"), ("s2", "s1"))
    assert candidate_pairs(("s1", "s2"), sequence, sequence_only) == (("s2", "s1"),)
    assert candidate_pairs(("s1", "s2"), sequence, settings) == (("s2", "s1"),)


@pytest.mark.parametrize("sequence", [None, ()])
def test_a_sequence_that_is_not_there_cannot_be_followed(sequence_only, sequence):
    with pytest.raises(SettingsError, match=r"matching\.pairs") as caught:
        candidate_pairs(STATIONS, sequence, sequence_only)
    assert caught.value.exit_status == 2


@pytest.mark.parametrize("stations", [(), ("s1",)])
def test_one_station_makes_no_pair(settings, stations):
    assert candidate_pairs(stations, None, settings) == ()


def test_scans_with_fewer_than_three_points_are_not_matched(settings, view, room):
    def few(count):
        scan = Scan(np.arange(count) * 0.5, np.full(count, 2.0), 40.0)
        return prepare_scan("few", scan, ScanSettings())

    prepared = {"none": few(0), "two": few(2), "three": few(3)}
    prepared["room"] = view("room", room, Pose2(2.0, 1.5, 0.0)).scan
    assert list(index_scans(prepared, settings)) == ["three", "room"]


def test_matches_come_pair_by_pair_best_first(three_room_scans, settings):
    wanted = (("s2", "s1"), ("s4", "s5"), ("s1", "s3"))
    told = []
    matches = match_pairs(
        wanted, three_room_scans, settings, progress=lambda *progress: told.append(progress)
    )
    assert told == [("matching scans", done, 3) for done in (1, 2, 3)]
    found = [(m.target, m.source) for m in matches]
    assert list(dict.fromkeys(found)) == list(wanted)
    assert found == sorted(found, key=wanted.index)
    for pair in wanted:
        ranks = [m.rank for m in matches if (m.target, m.source) == pair]
        assert ranks == list(range(len(ranks)))
        alone = match_pair(*(three_room_scans[s] for s in pair), settings)
        assert numbers(alone) == numbers(m for m in matches if (m.target, m.source) == pair)


def test_no_pairs_no_matches(three_room_scans, settings):
    assert match_pairs((), three_room_scans, settings) == ()


def test_several_processes_find_the_same_to_the_last_digit(
    three_room_scans, three_room_pairs, three_room_hypotheses, settings
):
    told = []
    with sharing(2) as share:
        parallel = match_pairs(
            three_room_pairs, three_room_scans, settings, lambda *p: told.append(p), share
        )
    assert numbers(parallel) == numbers(three_room_hypotheses)
    assert told[-1] == ("matching scans", len(three_room_pairs), len(three_room_pairs))
    assert len(told) == len(three_room_pairs)


def test_in_large_surveys_pairs_that_ranges_put_apart_are_left_out(settings):
    """Six stations in a row 4 m apart: within 8 m each has its next two neighbours."""
    stations = tuple("abcdef")
    places = 4.0 * np.arange(6)
    apart = np.abs(places[:, None] - places)
    few = settings.model_copy(update={"all_pairs_stations": 5})
    pairs = candidate_pairs(stations, None, few, apart)
    assert pairs == tuple((a, b) for a, b in combinations(stations, 2) if ord(b) - ord(a) <= 2)
    # The sequence is the operator's word, whatever the ranges say.
    assert ("f", "a") in candidate_pairs(stations, (("f", "a"),), few, apart)
    # Small surveys try all, and so do surveys without ranges.
    assert len(candidate_pairs(stations, None, settings, apart)) == 15
    assert len(candidate_pairs(stations, None, few)) == 15
