from __future__ import annotations

import math

import numpy as np
import pytest

from slam_uwb.graph.ranges import (
    Levers,
    anchor_sightings,
    build_range_table,
    link_reasons,
    range_prior,
    station_sightings,
    usable_links,
)
from slam_uwb.graph.variables import Variables
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import AnchorLink, GraphProblem, LinkMeasurement
from slam_uwb.model.settings import GraphSettings
from slam_uwb.model.survey import Anchor, RangeOffset, Station

SETTINGS = GraphSettings()
POSES = {"s1": Pose2(0.0, 0.0, math.pi / 2), "s2": Pose2(0.3, 0.0, 0.0), "s3": Pose2(5.0, 0.0, 0.0)}
# A station and an anchor share the name s1.
PLACES = {"A": np.array([3.0, 4.0]), "s1": np.array([0.0, -2.0])}
HEIGHTS = {"A": 2.4, "s1": 2.0}


def link(station, anchor, distance=5.0, **more) -> LinkMeasurement:
    return LinkMeasurement(station, anchor, distance, distance, 0.1, 10, **more)


def problem(links=(), anchor_links=(), **more) -> GraphProblem:
    return GraphProblem(
        stations=tuple(
            Station(n, None, math.nan if n == "deaf" else 1.4) for n in [*POSES, "deaf"]
        ),
        anchors=tuple(Anchor(name, height) for name, height in HEIGHTS.items()),
        matches=(),
        placement={},
        links=tuple(links),
        anchor_links=tuple(anchor_links),
        **more,
    )


def test_stations_side_by_side_share_one_error():
    links = [link(s, a) for s in POSES for a in PLACES]

    sigmas = {(k.station, k.anchor): k.sigma for k in usable_links(problem(links), POSES, SETTINGS)}

    # s1 and s2 are 0.3 m apart: two links for the price of one.
    assert sigmas["s1", "A"] == sigmas["s2", "A"] == pytest.approx(0.1 * math.sqrt(2.0))
    assert sigmas["s3", "A"] == pytest.approx(0.1)


def test_only_stations_that_hear_the_same_anchor_are_crowded():
    (one, _) = usable_links(problem([link("s1", "A"), link("s2", "s1")]), POSES, SETTINGS)

    assert one.sigma == pytest.approx(0.1)


def test_stations_that_are_not_placed_have_no_neighbours():
    links = [link("s1", "A"), link("s2", "A")]

    assert {k.sigma for k in usable_links(problem(links), {}, SETTINGS)} == {0.1}


def test_reasons_why_links_are_not_used():
    links = [
        link("s1", "A"),
        link("s2", "A", math.nan),
        link("deaf", "A"),
        link("s3", "A", rejection="by hand"),
    ]

    assert link_reasons(problem(links)) == (
        None, "no distance", "the height of the tag is not known", "by hand",
    )  # fmt: skip
    assert usable_links(problem(links), POSES, SETTINGS) == (links[0],)


def test_the_prior_of_the_offset_is_the_survey_s_word():
    assert range_prior(problem(), SETTINGS) == RangeOffset(0.18, 0.10)
    stated = RangeOffset(0.0, 0.05)
    assert range_prior(problem(range_offset=stated), SETTINGS) == stated


def test_a_lever_arm_needs_a_heading():
    levers = Levers(np.array([1.0, 0.0]), frozenset({"s1"}))

    tags = levers.tags(POSES)

    assert tags["s1"] == pytest.approx([0.0, 1.0])
    assert tags["s2"] == pytest.approx([0.3, 0.0])


def test_sightings_hold_tags_and_placed_anchors():
    given = problem([link("s1", "A", 5.1), link("s3", "A", 4.7)], [AnchorLink("s1", "A", 6.7, 0.2)])
    tags = {"s1": np.array([0.0, 0.0])}

    seen = anchor_sightings(given, given.links, "A", tags, {"s1": PLACES["s1"]}, HEIGHTS)

    # s3 is not among the tags; the anchor named s1 is at its own place and height.
    np.testing.assert_allclose(seen.points, [[0.0, 0.0], [0.0, -2.0]])
    np.testing.assert_allclose(seen.heights, [1.4, 2.0])
    np.testing.assert_allclose(seen.distances, [5.1, 6.7])
    np.testing.assert_allclose(seen.sigmas, [0.1, 0.2])


def test_a_tag_is_seen_from_placed_anchors_only():
    given = problem([link("s1", "A", 5.1), link("s1", "s1", 2.2)])

    seen = station_sightings(given.links, "s1", {"A": PLACES["A"]}, HEIGHTS)

    np.testing.assert_allclose(seen.points, [[3.0, 4.0]])


def test_residuals_of_the_table_by_hand():
    given = problem([link("s1", "A", 5.5), link("s2", "A", 9.0)], [AnchorLink("A", "s1", 7.0, 0.1)])
    variables = Variables({"s1": Pose2(1.0, 2.0, math.pi / 2)}, PLACES, 0.2)
    levers = Levers(np.array([0.0, 1.0]), frozenset({"s1"}))

    table = build_range_table(given, given.links, variables, HEIGHTS, levers, frozenset())

    # The lever (0, 1) turned by 90 degrees is (-1, 0): tag at (0, 2), anchor at (3, 4), 1 m above.
    # Anchors: (3, 4, 2.4) to (0, -2, 2.0). s2 is no variable.
    expected = [5.5 - 0.2 - math.sqrt(9 + 4 + 1), 7.0 - 0.2 - math.sqrt(9 + 36 + 0.16)]
    np.testing.assert_allclose(table.residuals(variables), expected)
