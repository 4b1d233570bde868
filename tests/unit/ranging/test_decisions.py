"""Dropped links are out, kept ones are in, and the ranges may say what they think of it."""

import math

from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.survey import Decision
from slam_uwb.ranging import decide_links, keep_links, review_links
from slam_uwb.ranging.decisions import DROPPED

FAULT = "1.20 m too long for the place that the other ranges give"


def link(anchor, residual=0.02, rejection=None, samples=60):
    return LinkMeasurement(
        "s1", anchor, 4.0, 4.0, 0.1, samples, residual=residual, rejection=rejection
    )


def test_a_dropped_link_gets_its_reason_and_no_other_does():
    links = (link("A"), link("B"))
    first, second = decide_links(
        links, [Decision("link", "s1", "A", "drop"), Decision("pair", "s1", "B", "drop")]
    )
    assert first.rejection == DROPPED
    assert second is links[1]


def test_dropping_a_link_that_fits_is_told():
    """Two sigmas are 0.2 m."""
    drop = Decision("link", "s1", "A", "drop")
    (good,) = review_links([drop], [link("A", residual=0.19, rejection=DROPPED)])
    assert "agrees with the others: residual +0.19 m" in good.contradiction
    for residual in (0.21, -0.5, math.nan):
        (bad,) = review_links([drop], [link("A", residual=residual, rejection=DROPPED)])
        assert (bad.effect, bad.contradiction) == ("not used", None)


def test_a_kept_link_is_used_though_it_is_called_a_fault():
    keep = Decision("link", "s1", "A", "keep")
    solved = [link("A", residual=1.2, rejection=FAULT), link("B", residual=1.2, rejection=FAULT)]
    kept, other = keep_links(solved, [keep])
    assert kept.rejection is None
    assert other is solved[1]
    (outcome,) = review_links([keep], solved)
    assert (outcome.effect, outcome.contradiction) == ("used", FAULT)


def test_nothing_is_made_of_a_link_without_ranges():
    keep = Decision("link", "s1", "A", "keep")
    empty = link("A", residual=math.nan, rejection="no usable sample (3 discarded)", samples=0)
    assert keep_links([empty], [keep]) == (empty,)
    for solved in ([empty], []):
        (outcome,) = review_links([keep], solved)
        assert outcome.effect == "not used"
        assert outcome.contradiction


def test_a_kept_link_of_an_anchor_without_a_place_says_that():
    unplaced = link("A", residual=math.nan, rejection="the anchor is unreachable")
    keep = Decision("link", "s1", "A", "keep")
    assert keep_links([unplaced], [keep]) == (unplaced,)
    (outcome,) = review_links([keep], [unplaced])
    assert (outcome.effect, outcome.contradiction) == ("not used", "the anchor is unreachable")
