from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.graph.chain import compose_chain, held_together, spanning_tree
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import GraphProblem, ScanMatch
from slam_uwb.model.survey import Station

NO_COVARIANCE = np.zeros((3, 3))


def match(target, source, pose=Pose2(1.0, 0.0, 0.0), score=1.0, covariance=None) -> ScanMatch:
    covariance = np.diag([1e-4, 1e-4, 1e-5]) if covariance is None else covariance
    return ScanMatch(target, source, pose, covariance, 0.5, 0.0, score, 0)


def problem(names, matches, sequence=None) -> GraphProblem:
    return GraphProblem(
        stations=tuple(Station(name, None, 1.4) for name in names),
        anchors=(),
        matches=tuple(matches),
        placement={name: Pose2.identity() for name in names},
        links=(),
        sequence=sequence,
    )


def pairs(tree) -> set[tuple[str, str]]:
    return {(edge.target, edge.source) for edge in tree}


def test_composition_is_equations_6_to_8_with_the_angle_negated():
    # The paper: tx = txm + tx cos + ty sin, ty = tym + ty cos - tx sin, theta = sum, whose angle
    # runs clockwise; ours runs the other way.
    m, nm = Pose2(1.0, -2.0, 0.7), Pose2(0.5, 0.3, -0.4)
    theta = -m.theta
    expected = (
        m.x + nm.x * math.cos(theta) + nm.y * math.sin(theta),
        m.y + nm.y * math.cos(theta) - nm.x * math.sin(theta),
        m.theta + nm.theta,
    )

    chain = compose_chain([match("m", "n", nm)], "m", m, NO_COVARIANCE)

    assert chain.poses["n"].vector == pytest.approx(expected)


def test_a_match_is_walked_backwards_where_the_root_is_its_source():
    truth = Pose2(2.0, 1.0, 0.5)

    chain = compose_chain([match("b", "a", truth)], "a", Pose2.identity(), NO_COVARIANCE)

    assert (truth @ chain.poses["b"]).vector == pytest.approx([0.0, 0.0, 0.0])


def test_covariances_are_those_of_many_draws():
    # a - b forwards, c - b backwards; covariances long in one axis.
    rng = np.random.default_rng(0)
    covariance = np.diag([0.02**2, 0.005**2, 0.01**2])
    ab, cb = Pose2(3.0, 1.0, 0.8), Pose2(-2.0, 0.5, -1.2)
    truth = compose_chain(
        [match("a", "b", ab), match("c", "b", cb)], "a", Pose2.identity(), NO_COVARIANCE
    )
    root = 1e-4 * np.eye(3)
    chain = compose_chain(
        [match("a", "b", ab, covariance=covariance), match("c", "b", cb, covariance=covariance)],
        "a", Pose2.identity(), root,
    )  # fmt: skip
    errors = []
    for _ in range(4000):
        noise = [
            Pose2(*(np.sqrt(np.diag(c)) * rng.standard_normal(3)))
            for c in (root, covariance, covariance)
        ]
        drawn = compose_chain(
            [match("a", "b", ab @ noise[1]), match("c", "b", cb @ noise[2])],
            "a",
            noise[0],
            NO_COVARIANCE,
        )
        errors.append(
            np.concatenate([(truth.poses[n].inverse() @ p).vector for n, p in drawn.poses.items()])
        )
    sampled = np.cov(np.array(errors).T)
    scale = np.sqrt(np.diag(chain.covariance))
    # A correlation of 4,000 draws is known to 0.016: five of them.
    np.testing.assert_allclose(
        sampled / np.outer(scale, scale), chain.covariance / np.outer(scale, scale), atol=0.08
    )


def test_the_tree_takes_the_best_scores():
    matches = [match("a", "b", score=1.0), match("b", "c", score=5.0), match("c", "a", score=3.0)]

    assert pairs(spanning_tree(problem("abc", matches))) == {("b", "c"), ("c", "a")}


def test_the_sequence_comes_first_and_gaps_are_filled():
    matches = [
        match("a", "b", score=1.0), match("b", "c", score=5.0), match("a", "c", score=4.0),
        match("c", "d", score=2.0), match("b", "d", score=3.0),
    ]  # fmt: skip

    # (c, b) is the same pair as (b, c); (d, e) has no match; d is attached by the better one.
    tree = spanning_tree(problem("abcd", matches, sequence=(("a", "b"), ("c", "b"), ("d", "e"))))

    assert pairs(tree) == {("a", "b"), ("b", "c"), ("b", "d")}


def test_a_match_that_leaves_a_direction_free_is_the_last_resort():
    free = replace(match("a", "b", score=9.0), degenerate=True)
    around = [match("b", "c"), match("a", "c")]
    sequence = (("a", "b"),)
    assert pairs(spanning_tree(problem("abc", [free, *around], sequence))) == {
        ("b", "c"),
        ("a", "c"),
    }
    # Where nothing else reaches a station, it holds two directions of three.
    assert pairs(spanning_tree(problem("abc", [free, around[0]]))) == {("a", "b"), ("b", "c")}


def test_the_tree_does_not_depend_on_the_order_of_equal_scores():
    matches = [match("a", "b"), match("b", "c"), match("a", "c")]

    assert pairs(spanning_tree(problem("abc", matches))) == pairs(
        spanning_tree(problem("cba", matches[::-1]))
    )


def test_the_largest_group_holds_together():
    matches = [match("a", "b"), match("d", "c"), match("d", "e")]

    assert held_together(problem("abcdef", matches)) == ("c", "d", "e")
    assert held_together(problem("fab", matches[:1])) == ("a", "b")
    assert held_together(problem("abc", [])) == ()
