"""What an earlier solution rests on must not have changed; everything that has is named."""

from dataclasses import replace

import pytest

from slam_uwb import solve_survey
from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import DecisionOutcome
from slam_uwb.model.survey import Decision


def another_scan(survey):
    scan = survey.stations[2].scan
    ranges = scan.ranges.copy()
    ranges[:200] *= 1.01
    station = replace(survey.stations[2], scan=replace(scan, ranges=ranges))
    return replace(survey, stations=(*survey.stations[:2], station, *survey.stations[3:]))


def no_scan(survey):
    station = replace(survey.stations[2], scan=None)
    return replace(survey, stations=(*survey.stations[:2], station, *survey.stations[3:]))


def another_range(survey):
    first, *others = survey.ranges
    return replace(survey, ranges=(replace(first, distances=first.distances + 0.01), *others))


def no_range(survey):
    return replace(survey, ranges=survey.ranges[1:])


def without(survey):
    return replace(survey, stations=survey.stations[1:], ranges=())


def decided(survey):
    return replace(survey, decisions=(Decision("pair", "s01", "s02", "drop"),))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (another_scan, "the scan of s03 has changed"),
        (no_scan, "station s03 has lost its scan"),
        (another_range, "ranges have changed: s01 to A"),
        (no_range, "ranges have changed: s01 to A"),
        (without, "station s01 is not in the survey"),
        (without, "it was solved with ranges"),
        (decided, "the decision about the pair s01, s02 has changed"),
    ],
)
def test_a_survey_that_has_changed_is_refused(flat, earlier, change, named):
    with pytest.raises(SlamUwbError, match=named) as refusal:
        solve_survey(change(flat.survey), earlier=earlier)
    assert "solve without --continue" in str(refusal.value)
    assert refusal.value.exit_status == 2


def test_other_software_and_settings_are_refused(flat, earlier):
    with pytest.raises(SlamUwbError, match=r"solved by version 0\.0\.0, this is"):
        solve_survey(flat.survey, earlier=replace(earlier, software_version="0.0.0"))
    settings = Settings()
    matching = settings.matching.model_copy(update={"min_overlap": 0.33})
    chosen = settings.model_copy(update={"matching": matching})
    with pytest.raises(SlamUwbError, match=r"matching\.min_overlap is 0\.33, it was"):
        solve_survey(flat.survey, chosen, earlier=earlier)


def test_no_ranges_after_ranges_is_refused(flat, earlier):
    with pytest.raises(SlamUwbError, match="it was solved with ranges"):
        solve_survey(flat.survey, earlier=earlier, use_ranges=False)


def test_what_comes_after_matching_may_change(flat, earlier):
    """Another mode, and decisions about links and about the new station: those steps run again."""
    settings = Settings()
    graph = settings.graph.model_copy(update={"mode": "sequential"})
    decisions = (
        Decision("link", "s01", "A1", "drop"),
        Decision("pair", "s01", "s06", "drop"),
    )
    told = replace(earlier, decisions=(DecisionOutcome(decisions[0], "not used"),))
    solution = solve_survey(
        replace(flat.survey, decisions=decisions),
        settings.model_copy(update={"graph": graph}),
        earlier=told,
    )
    assert solution.mode == "sequential"
    assert solution.stations[5].pose is not None
    assert not any(m.ends == {"s01", "s06"} for m in solution.matches if m.rejection is None)


def test_a_new_anchor_may_have_been_heard_before(flat, earlier):
    """Its ranges are new at every station; the matches do not rest on them."""
    gone = earlier.anchors[0].id
    fewer = replace(
        earlier,
        anchors=earlier.anchors[1:],
        links=tuple(link for link in earlier.links if link.anchor != gone),
    )
    solution = solve_survey(flat.survey, earlier=fewer)
    assert gone in {anchor.id for anchor in solution.anchors}
    assert gone not in {move.id for move in solution.continued.moves}
