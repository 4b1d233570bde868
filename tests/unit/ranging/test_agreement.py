"""What the ranges of two groups of stations say of how the groups lie to each other."""

import math

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.survey import Anchor, Station, Survey
from slam_uwb.ranging import range_gain

STATIONS = {
    "a1": (0.0, 0.0), "a2": (3.0, 0.5), "a3": (1.0, 3.0),
    "b1": (6.0, 1.0), "b2": (8.0, 3.0), "b3": (5.5, 4.5),
}  # fmt: skip
ANCHORS = {"A1": (2.0, 6.0), "A2": (9.0, -1.0), "A3": (-2.0, 2.0), "A4": (5.0, -3.0)}
RISE = 1.0
A, B = ("a1", "a2", "a3"), ("b1", "b2", "b3")
# Frames of the two groups, anywhere.
WORLD_T_A, WORLD_T_B = Pose2(1.0, -2.0, 0.7), Pose2(4.0, 3.0, -2.0)
TRUTH = WORLD_T_A.inverse() @ WORLD_T_B


def survey(tag_offset=(0.0, 0.0)):
    return Survey(
        name="two groups",
        stations=tuple(Station(name, None, tag_height=1.4) for name in STATIONS),
        anchors=tuple(Anchor(name, 1.4 + RISE) for name in ANCHORS),
        tag_offset=tag_offset,
    )


def links(extra=lambda _station, _anchor: 0.2, anchors=tuple(ANCHORS)):
    found = []
    for station, (x, y) in STATIONS.items():
        for anchor in anchors:
            u, v = ANCHORS[anchor]
            d = math.hypot(u - x, v - y, RISE) + extra(station, anchor)
            found.append(LinkMeasurement(station, anchor, d, d, 0.1, 50))
    return tuple(found)


def group(names, world_T_group):
    inverse = world_T_group.inverse()
    return {name: inverse @ Pose2(*STATIONS[name], 0.0) for name in names}


def gains(candidates, measured):
    gain = range_gain(survey(), measured)
    vectors = np.array([pose.vector for pose in candidates])
    return gain(group(A, WORLD_T_A), group(B, WORLD_T_B), vectors)


def test_the_truth_beats_every_displacement_and_to_leave_it():
    moved = [
        TRUTH @ Pose2(2.5 * math.cos(t), 2.5 * math.sin(t), 0.0)
        for t in np.arange(0, 6, math.pi / 4)
    ]
    turned = [TRUTH @ Pose2(0.0, 0.0, t) for t in (math.pi / 2, math.pi, -math.pi / 2)]
    found = gains([TRUTH, *moved, *turned], links())
    assert found[0] > 3.0
    assert found[0] > found[1:].max() + 3.0


def test_walls_that_make_ranges_long_do_not_refuse_the_truth():
    # Every second link is 1.2 m long, as behind two walls.
    def extra(station, anchor):
        return 0.2 + 1.2 * ((int(station[1]) + int(anchor[1])) % 2)

    true, wrong = gains([TRUTH, TRUTH @ Pose2(0.0, 5.0, math.pi)], links(extra))
    assert true > 0.0
    assert true > wrong + 2.0


def test_one_absurd_link_costs_a_bounded_amount():
    clean = gains([TRUTH], links())[0]
    spoilt = gains([TRUTH], links(lambda s, a: 25.0 if (s, a) == ("b1", "A1") else 0.2))[0]
    # The floor of the density, 0.05 / 30 per metre, against its top of about 1.3: 6.7 nats, and
    # what the other links to the anchor lose with it.
    assert clean - 15.0 < spoilt < clean


def test_groups_that_hear_no_anchor_in_common_say_nothing():
    measured = [link for link in links() if (link.station in A) == (link.anchor in ("A1", "A2"))]
    assert gains([TRUTH, Pose2(50.0, 0.0, 1.0)], measured).tolist() == [0.0, 0.0]


def test_rejected_links_do_not_count():
    refused = [
        LinkMeasurement(k.station, k.anchor, k.distance, k.mean, k.sigma, 0, rejection="no sample")
        for k in links()
    ]
    assert gains([TRUTH], refused).tolist() == [0.0]


def test_swapping_the_groups_changes_nothing_but_the_grid():
    gain = range_gain(survey(), links())
    a, b = group(A, WORLD_T_A), group(B, WORLD_T_B)
    there = gain(a, b, TRUTH.vector[None, :])[0]
    back = gain(b, a, TRUTH.inverse().vector[None, :])[0]
    # Cells of 0.5 m lie differently: a nat or so for four anchors.
    assert there == pytest.approx(back, abs=1.5)


def test_the_lever_arm_of_the_tag_counts():
    # Every tripod's antenna sits 2 m beside the scanner (absurd, but plain): poses whose tags are
    # where the ranges were taken are right, those whose scanners are there are not.
    offset = Pose2(2.0, 0.0, 0.0)
    gain = range_gain(survey(tag_offset=(2.0, 0.0)), links())

    def scanners(names, world_T_group):
        headings = {name: 0.9 * k for k, name in enumerate(names)}
        inverse = world_T_group.inverse()
        return {n: inverse @ Pose2(*STATIONS[n], headings[n]) @ offset.inverse() for n in names}

    right = gain(scanners(A, WORLD_T_A), scanners(B, WORLD_T_B), TRUTH.vector[None, :])[0]
    assert right == pytest.approx(gains([TRUTH], links())[0], abs=1e-9)
