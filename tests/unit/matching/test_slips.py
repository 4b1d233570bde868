from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.evidence import single_block
from slam_uwb.matching.gain import merge_blocks
from slam_uwb.matching.hypotheses import describe_match
from slam_uwb.matching.slips import without_slips
from slam_uwb.model.geometry import Pose2

STATIONS = ("s3", "s4", "s5")
SLIP = Pose2(0.25, -0.15, 0.02)


@pytest.fixture
def block(three_room_scans, three_room_poses, settings):
    """(step of s4) -> a block of three stations, right but for that step."""

    def placed(step):
        grown = single_block(STATIONS[0], three_room_scans[STATIONS[0]])
        for station in STATIONS[1:]:
            pose = three_room_poses[STATIONS[0]].inverse() @ three_room_poses[station]
            pose = pose @ step if station == "s4" else pose
            alone = single_block(station, three_room_scans[station])
            grown = merge_blocks(grown, alone, pose.vector, three_room_scans, settings)
        return grown

    return placed


@pytest.fixture
def match(three_room_scans, three_room_poses, settings):
    """(target, source, step of the source) -> their match, one that holds every direction."""

    def described(target, source, step=None):
        pose = three_room_poses[target].inverse() @ three_room_poses[source]
        pose = pose @ (step or Pose2.identity())
        ends = (three_room_scans[s] for s in (target, source))
        return replace(describe_match(*ends, pose.vector, 0, settings), degenerate=False)

    return described


@pytest.mark.parametrize("pair", [("s5", "s4"), ("s4", "s5")])
def test_a_station_that_slid_goes_back_to_where_a_match_has_it(
    block, match, three_room_scans, three_room_poses, settings, pair
):
    poses = without_slips(block(SLIP), three_room_scans, [match(*pair)], settings)
    for station in STATIONS:
        truth = three_room_poses["s3"].inverse() @ three_room_poses[station]
        np.testing.assert_allclose(poses[station].vector, truth.vector, atol=1e-9)


def test_a_match_that_may_have_slid_itself_moves_nothing(block, match, three_room_scans, settings):
    slid = block(SLIP)
    sliding = replace(match("s5", "s4"), degenerate=True)
    assert without_slips(slid, three_room_scans, [sliding], settings) == slid.poses


def test_a_station_stays_where_its_walls_are(block, match, three_room_scans, settings):
    right = block(Pose2.identity())
    assert (
        without_slips(right, three_room_scans, [match("s5", "s4", SLIP)], settings) == right.poses
    )


@pytest.mark.parametrize("step", [Pose2(0.02, 0.03, 0.0), Pose2(1.5, 1.0, 0.0)])
def test_places_that_refining_finds_and_other_places_are_left_alone(
    block, match, three_room_scans, settings, step
):
    moved = block(step)
    assert without_slips(moved, three_room_scans, [match("s5", "s4")], settings) == moved.poses


def test_matches_of_stations_elsewhere_are_passed_over(block, match, three_room_scans, settings):
    slid = block(SLIP)
    others = [match("s1", "s2"), match("s4", "s6")]
    assert without_slips(slid, three_room_scans, others, settings) == slid.poses
