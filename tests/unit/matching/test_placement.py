import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from slam_uwb.matching.evidence import single_block
from slam_uwb.matching.gain import merge_blocks
from slam_uwb.matching.growth import Growth
from slam_uwb.matching.hypotheses import describe_match
from slam_uwb.matching.merging import best_merge, no_ranges, touching_stations
from slam_uwb.matching.placement import (
    _next_merge,
    _second_look,
    _settled,
    _settled_merge,
    place_stations,
)
from slam_uwb.model.geometry import Pose2


def assert_at_the_truth(poses, truth, metres=0.03, degrees=0.5):
    """All stations of the block as they truly lie to each other."""
    first = next(iter(poses))
    for station, pose in poses.items():
        error = (truth[first].inverse() @ truth[station]).inverse() @ (
            poses[first].inverse() @ pose
        )
        assert error.distance_to(Pose2.identity()) < metres
        assert abs(error.theta) < math.radians(degrees)


def hypothesis(scans, target, source, pose, settings, rank=0):
    return describe_match(scans[target], scans[source], pose.vector, rank, settings)


def test_three_rooms_merge_to_the_truth(
    three_room_scans, three_room_hypotheses, three_room_poses, settings
):
    told = []
    blocks = place_stations(
        three_room_scans,
        three_room_hypotheses,
        settings,
        progress=lambda *progress: told.append(progress),
    )
    assert len(blocks) == 1
    assert blocks[0].poses.keys() == three_room_poses.keys()
    assert_at_the_truth(blocks[0].poses, three_room_poses)
    assert told == [("placing stations", done, 6) for done in range(1, 7)]


def test_the_frame_is_that_of_the_blocks_first_station(
    three_room_scans, three_room_hypotheses, settings
):
    block = place_stations(three_room_scans, three_room_hypotheses, settings)[0]
    assert block.poses[next(iter(block.poses))] == Pose2.identity()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_order_of_stations_and_hypotheses_does_not_matter(
    three_room_scans, three_room_hypotheses, three_room_poses, settings, seed
):
    rng = np.random.default_rng(seed)
    stations = {s: three_room_scans[s] for s in rng.permutation(list(three_room_scans))}
    hypotheses = [three_room_hypotheses[k] for k in rng.permutation(len(three_room_hypotheses))]
    blocks = place_stations(stations, hypotheses, settings)
    assert len(blocks) == 1
    assert_at_the_truth(blocks[0].poses, three_room_poses)


def test_which_scan_was_fitted_to_which_does_not_matter(
    three_room_scans, three_room_hypotheses, three_room_poses, settings
):
    swapped = [
        hypothesis(
            three_room_scans, m.source, m.target, m.target_T_source.inverse(), settings, m.rank
        )
        for m in three_room_hypotheses
    ]
    blocks = place_stations(three_room_scans, swapped, settings)
    assert len(blocks) == 1
    assert_at_the_truth(blocks[0].poses, three_room_poses)


def test_the_merged_map_overrules_the_best_hypothesis_of_a_pair(
    three_room_scans, three_room_hypotheses, three_room_poses, settings
):
    """Pairs of different rooms whose best hypothesis is wrong are placed right by the others."""
    slip = Pose2(1.5, 0.0, 0.0)
    wrong = [
        replace(m, target_T_source=slip @ m.target_T_source, score=m.score + 5.0)
        for m in three_room_hypotheses
        if m.rank == 0
    ]
    blocks = place_stations(three_room_scans, [*wrong, *three_room_hypotheses], settings)
    assert_at_the_truth(blocks[0].poses, three_room_poses)


def test_a_station_elsewhere_stays_alone(
    view, room, three_room_scans, three_room_hypotheses, three_room_poses, settings
):
    scans = {"other": view("other", room, Pose2(2, 1.5, 0.0)), **three_room_scans}
    blocks = place_stations(scans, three_room_hypotheses, settings)
    assert [len(block.poses) for block in blocks] == [7, 1]
    assert dict(blocks[1].poses) == {"other": Pose2.identity()}
    assert_at_the_truth(blocks[0].poses, three_room_poses)


def test_blocks_come_by_size_then_by_the_surveys_order(
    three_room_scans, three_room_hypotheses, settings
):
    within = [
        m for m in three_room_hypotheses
        if {m.target, m.source} in ({"s1", "s2"}, {"s5", "s6"}, {"s6", "s7"}, {"s5", "s7"})
    ]  # fmt: skip
    blocks = place_stations(three_room_scans, within, settings)
    assert [sorted(block.poses) for block in blocks] == [
        ["s5", "s6", "s7"], ["s1", "s2"], ["s3"], ["s4"],
    ]  # fmt: skip


def test_no_margin_is_wide_enough_where_more_is_asked(
    three_room_scans, three_room_hypotheses, settings
):
    strict = settings.model_copy(update={"min_margin_m": 1e6})
    assert len(place_stations(three_room_scans, three_room_hypotheses, strict)) == 7


def test_a_wall_counts_once_however_many_scans_confirm_it(view, room, settings):
    """A scanner that sees 2 m far is confirmed by five others no better than by one.

    Two scans alone confirm each other: twice the wall that the short-sighted one sees. Once the
    five are together, they confirm their own walls, and it brings its own wall alone.
    """
    scans = {f"a{k}": view(f"a{k}", room, Pose2(2.0, 1.5, 0.1 * k)) for k in range(5)}
    scans["b"] = view("b", room, Pose2(2.4, 1.6, 0.0), max_range=2.0)
    seen = float(scans["b"].scan.lengths.sum())
    right = Pose2(2.0, 1.5, 0.0).inverse() @ Pose2(2.4, 1.6, 0.0)
    together = [
        hypothesis(scans, "a0", f"a{k}", Pose2(0.0, 0.0, 0.1 * k), settings) for k in range(1, 5)
    ]
    joined = hypothesis(scans, "a0", "b", right, settings)
    once = settings.model_copy(update={"min_margin_m": 1.3 * seen})
    two = {"a0": scans["a0"], "b": scans["b"]}
    assert len(place_stations(two, [joined], once)) == 1
    blocks = place_stations(scans, [*together, joined], once)
    assert [sorted(block.poses) for block in blocks] == [["a0", "a1", "a2", "a3", "a4"], ["b"]]
    enough = settings.model_copy(update={"min_margin_m": 0.6 * seen})
    assert len(place_stations(scans, [*together, joined], enough)) == 1


@pytest.mark.parametrize("count", [0, 1])
def test_without_hypotheses_every_station_is_alone(three_room_scans, settings, count):
    scans = dict(list(three_room_scans.items())[:count])
    assert [list(block.poses) for block in place_stations(scans, (), settings)] == [
        [station] for station in scans
    ]


@pytest.fixture
def drifted_parts(three_room_scans, three_room_poses, settings):
    """Two parts of three rooms, each with a station that drifted while it grew."""

    def part(names, drifted, drift):
        block = single_block(names[0], three_room_scans[names[0]])
        for name in names[1:]:
            place = three_room_poses[names[0]].inverse() @ three_room_poses[name]
            place = place @ drift if name == drifted else place
            alone = single_block(name, three_room_scans[name])
            block = merge_blocks(block, alone, place.vector, three_room_scans, settings)
        return block

    drift = Pose2(0.25, -0.2, 0.06)
    return part(("s1", "s2", "s3"), "s3", drift), part(("s4", "s5", "s6", "s7"), "s4", drift)


@pytest.fixture
def best(three_room_scans, three_room_hypotheses, settings):
    """The best merge of two blocks by the hypotheses of the three rooms."""
    return partial(
        best_merge,
        scans=three_room_scans,
        touching=touching_stations(three_room_hypotheses),
        settings=settings,
        range_gain=no_ranges,
    )


def test_parts_that_drifted_merge_once_their_stations_may_move(
    three_room_scans, three_room_poses, drifted_parts, best, settings
):
    truth = three_room_poses

    def settle(poses):
        first = next(iter(poses))
        return {station: truth[first].inverse() @ truth[station] for station in poses}

    growth = Growth(dict(enumerate(drifted_parts)), {0: {1}, 1: {0}}, {})
    growth.add_unseen((0, 1), math.inf)
    assert _next_merge(growth, best, three_room_scans, settings) is None
    settled = partial(_settled, scans=three_room_scans, settings=settings, settle=settle)
    done = set()
    pair, merged = _settled_merge(growth, done, settled, best, three_room_scans, settings)
    assert pair == (0, 1)
    assert done == {0, 1}
    assert merged.poses.keys() == truth.keys()
    assert_at_the_truth(merged.poses, truth)


def test_blocks_that_have_not_grown_are_not_settled_again(
    drifted_parts, three_room_scans, settings
):
    growth = Growth(dict(enumerate(drifted_parts)), {0: {1}, 1: {0}}, {})
    asked = []

    def settled(block):
        asked.append(block)
        return block

    def never(_a, _b):
        return None

    done = set()
    for _ in range(2):
        assert _settled_merge(growth, done, settled, never, three_room_scans, settings) is None
    assert asked == list(drifted_parts)


def test_parts_that_settling_alone_leaves_apart_get_a_second_look(
    three_room_scans, three_room_poses, drifted_parts, best, settings
):
    """What each part does not know of its own drift, both together do."""
    truth = three_room_poses

    def settled(block):
        if len(block.poses) < len(truth):
            return block
        first = next(iter(block.poses))
        places = {s: truth[first].inverse() @ truth[s] for s in block.poses}
        return _settled(block, three_room_scans, settings, lambda _: places)

    blocks = dict(enumerate(drifted_parts))
    assert _second_look(blocks, best, three_room_scans, settings, lambda block: block) is None
    pair, merged = _second_look(blocks, best, three_room_scans, settings, settled)
    assert pair == (0, 1)
    assert_at_the_truth(merged.poses, truth)


def test_what_settling_cannot_mend_stays_apart(
    three_room_scans, three_room_poses, drifted_parts, settings
):
    """One hypothesis, through the wall: no settling makes the walls agree."""
    wrong = three_room_poses["s3"].inverse() @ three_room_poses["s4"] @ Pose2(1.5, 1.0, 1.0)
    best = partial(
        best_merge,
        scans=three_room_scans,
        touching=touching_stations([hypothesis(three_room_scans, "s3", "s4", wrong, settings)]),
        settings=settings,
        range_gain=no_ranges,
    )
    blocks = dict(enumerate(drifted_parts))
    assert _second_look(blocks, best, three_room_scans, settings, lambda block: block) is None
