from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from slam_uwb.graph import factors
from slam_uwb.graph.feeding import anchor_bends, feed_ranges
from slam_uwb.graph.ranges import RangeTable, weigh_ranges
from slam_uwb.graph.variables import Indices, Variables, to_values
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import RangingSettings
from slam_uwb.ranging import link_model

INDICES = Indices({f"s{k}": k for k in range(5)}, {"A": 0})
POSES = {
    f"s{k}": Pose2(x, y, 0.7 * k)
    for k, (x, y) in enumerate([(0.0, 0.0), (4.0, 0.5), (7.5, 0.2), (7.0, 5.0), (0.5, 5.1)])
}
PRESENT = Variables(POSES, {"A": np.array([3.0, 7.0])}, 0.1, {"A": 0.02})
MODEL = link_model(RangingSettings())


def weighed(errors):
    """Five ranges to one anchor that are longer than to its place by `errors`, m."""
    count = len(errors)
    table = RangeTable(
        stations=tuple(POSES),
        anchors=("A",),
        lost=frozenset(),
        levers=np.tile([0.1, -0.05], (count, 1)),
        first=np.arange(count),
        second=np.full(count, count),
        measured=np.zeros(count),
        sigmas=np.full(count, 0.1),
        rises=np.full(count, 1.1),
    )
    table = replace(table, measured=errors - table.residuals(PRESENT))
    return weigh_ranges(table, MODEL.unlabelled(count), MODEL)


def cost(ranges, step):
    """Of the ranges, with the anchor and its offset elsewhere by `step` (3,), m."""
    moved = replace(
        PRESENT, anchors={"A": PRESENT.anchors["A"] + step[:2]}, delays={"A": 0.02 + step[2]}
    )
    return float(ranges.density.costs(ranges.table.residuals(moved)).sum())


def information(fed, bends=()):
    """(3, 3) by the anchor's place and offset, and (3,) gradient, of fed factors and bends."""
    values, graph = to_values(PRESENT, INDICES, with_offset=True), gtsam.GaussianFactorGraph()
    for factor in fed:
        graph.push_back(factor.linearize(values))
    for bend in bends:
        graph.push_back(bend)
    ordering = gtsam.Ordering()
    keys = {*graph.keyVector()} - {factors.L(0), factors.D(0)}
    for key in (factors.L(0), factors.D(0), *sorted(keys)):
        ordering.push_back(key)
    hessian, right = graph.hessian(ordering)
    return hessian[:3, :3], -right[:3]


def bends_of(ranges):
    """At the present estimate."""
    return anchor_bends(ranges, ranges.expand(ranges.table.places(PRESENT)), INDICES)


ERRORS = np.array([0.02, 0.6, -0.05, 0.1, 0.9])


def test_fed_ranges_and_bends_are_the_cost_to_second_order():
    ranges, h = weighed(ERRORS), 1e-3
    values = to_values(PRESENT, INDICES, with_offset=True)
    fed = feed_ranges(ranges, PRESENT, values, INDICES, safe=False)
    bends = bends_of(ranges)
    steps = h * np.eye(3)
    slope = [(cost(ranges, s) - cost(ranges, -s)) / (2 * h) for s in steps]
    curvature = [
        [
            (cost(ranges, a + b) - cost(ranges, a - b) - cost(ranges, b - a) + cost(ranges, -a - b))
            / (4 * h**2)
            for b in steps
        ]
        for a in steps
    ]

    assert len(bends) == 1
    hessian, gradient = information(fed, bends)

    np.testing.assert_allclose(gradient, slope, rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(hessian, curvature, rtol=1e-2, atol=0.5)
    # Without the bends it is another one.
    assert np.abs(information(fed)[0] - curvature).max() > 2.0


def test_an_anchor_that_its_ranges_do_not_hold_gets_no_bend():
    # All far out in the tails of walls, where costs bend the other way.
    ranges = weighed(np.full(5, 2.5))

    assert bends_of(ranges) == []


@pytest.mark.parametrize("safe", [True, False])
def test_the_derivative_by_a_pose_is_that_of_its_tag(safe):
    ranges = weighed(ERRORS)
    values = to_values(PRESENT, INDICES, with_offset=True)
    factor = feed_ranges(ranges, PRESENT, values, INDICES, safe)[1]
    matrix = factor.linearize(values).jacobian()[0][0]
    table = ranges.table
    curvature = ranges.let_in(ranges.expand(table.places(PRESENT)), safe)[1]
    h, expected = 1e-6, []
    for step in h * np.eye(3):
        ends = []
        for sign in (1.0, -1.0):
            # A small step in the pose's own axes.
            pose = POSES["s1"] @ Pose2(*(sign * step))
            moved = replace(PRESENT, poses={**POSES, "s1": pose})
            ends.append(table.spans(table.places(moved)).slants[1])
        expected.append((ends[0] - ends[1]) / (2 * h))

    keys = list(factor.keys())
    blocks = dict(
        zip(keys, np.split(matrix, np.cumsum([sizes(k) for k in keys])[:-1]), strict=True)
    )
    np.testing.assert_allclose(
        blocks[factors.X(1)] / np.sqrt(curvature), expected, rtol=1e-6, atol=1e-8
    )


def sizes(key):
    return {"x": 3, "l": 2, "d": 1, "b": 1}[chr(gtsam.symbolChr(key))]
