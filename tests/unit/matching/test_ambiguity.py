"""Stations that would fit elsewhere are found, in repeating buildings and in no others."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from slam_uwb.matching.ambiguity import ambiguous_stations
from slam_uwb.matching.hypotheses import describe_match
from slam_uwb.matching.merging import no_ranges
from slam_uwb.matching.pairs import candidate_pairs, match_pairs
from slam_uwb.matching.placement import place_stations
from slam_uwb.model.geometry import Pose2
from slam_uwb.simulate.plan import Wall, build_plan


def test_rooms_that_differ_leave_no_station_ambiguous(
    three_room_scans, three_room_hypotheses, settings
):
    block = place_stations(three_room_scans, three_room_hypotheses, settings)[0]
    assert len(block.poses) == 7
    found = ambiguous_stations(block, three_room_scans, three_room_hypotheses, settings, no_ranges)
    assert found == {}


def test_a_station_alone_has_no_place_to_doubt(three_room_scans, settings):
    block = place_stations(three_room_scans, (), settings)[0]
    assert ambiguous_stations(block, three_room_scans, (), settings, no_ranges) == {}


def test_a_second_copy_of_the_room_makes_its_station_ambiguous(
    three_room_scans, three_room_hypotheses, settings
):
    """With walls that deny nothing, a place that confirms as much is as good; ranges may refuse it."""
    block = place_stations(three_room_scans, three_room_hypotheses, settings)[0]
    blind = settings.model_copy(update={"violation_weight": 0.0, "min_margin_m": 1e-3})
    found = ambiguous_stations(block, three_room_scans, three_room_hypotheses, blind, no_ranges)
    assert found
    for station, rival in found.items():
        away = rival.pose.distance_to(block.poses[station])
        assert away > 1.0 or rival.pose.angle_to(block.poses[station]) > 0.5

    def here_alone(_rest, alone, candidates):
        station = next(iter(alone))
        here = block.poses[station].vector
        away = np.abs(candidates - here).max(axis=1)
        return np.where(away > 0.3, -40.0, 0.0)

    refused = ambiguous_stations(block, three_room_scans, three_room_hypotheses, blind, here_alone)
    assert refused == {}


def test_equal_rooms_laid_over_each_other_are_ambiguous_as_one(view, settings):
    """Two of them in the place of a third hold each other there: each alone has no other place."""
    rooms = [
        wall
        for x in (0, 6, 12)
        for wall in (
            Wall((x, 2), (x + 6, 2), doors=((x + 2.7, 1.0),)),
            Wall((x, 2), (x, 6)),
            Wall((x + 4, 4.5), (x + 4, 6)),
        )
    ]
    corridor = [
        Wall((0, 0), (18, 0)),
        Wall((0, 0), (0, 2)),
        Wall((18, 0), (18, 6)),
        Wall((0, 6), (18, 6)),
    ]
    # Piers of the corridor tell its own stations apart.
    piers = [
        Wall((x, 0), (x, depth)) for x, depth in ((1.2, 0.5), (7.4, 0.8), (10.1, 0.6), (16.2, 0.7))
    ]
    faces = build_plan([*rooms, *corridor, *piers], []).faces
    truth = {
        "c1": Pose2(2.8, 1.0, 0.1), "c2": Pose2(8.6, 1.1, 1.2), "c3": Pose2(14.8, 0.9, -2.0),
        "c4": Pose2(5.6, 1.0, 0.7), "c5": Pose2(11.7, 1.1, -0.4), "c6": Pose2(17.0, 0.8, 3.0),
        "r1": Pose2(2.6, 3.6, 0.4), "r2": Pose2(8.9, 3.5, 2.2),
    }  # fmt: skip
    rng = np.random.default_rng(3)
    scans = {s: view(s, faces, pose, rng, 0.005) for s, pose in truth.items()}
    hypotheses = match_pairs(candidate_pairs(tuple(scans), None, settings), scans, settings)
    third = {
        **truth,
        "r1": Pose2(12, 0, 0) @ truth["r1"],
        "r2": Pose2(6, 0, 0) @ truth["r2"],
    }

    def firm(a, b):
        pose = (third[a].inverse() @ third[b]).vector
        return describe_match(scans[a], scans[b], pose, 0, settings)

    doors = [firm(a, b) for a, b in pairwise(["c1", "c4", "c2", "c5", "c3", "c6"])]
    wrong = [*doors, firm("r1", "r2"), firm("c3", "r1")]
    block = place_stations(scans, hypotheses, settings, firm=wrong)[0]
    assert len(block.poses) == 8
    found = ambiguous_stations(block, scans, hypotheses, settings, no_ranges)
    assert {"r1", "r2"} <= found.keys()
    # Both go together, to the first room or the second.
    ways = [found[s].pose @ block.poses[s].inverse() for s in ("r1", "r2")]
    assert ways[0].distance_to(ways[1]) < 1e-9
    alone = ambiguous_stations(replace(block, parts=()), scans, hypotheses, settings, no_ranges)
    assert not {"r1", "r2"} & alone.keys()
