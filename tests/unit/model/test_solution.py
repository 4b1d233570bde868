import numpy as np
import pytest

from slam_uwb.model.floor import FloorMap
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement
from slam_uwb.model.solution import (
    AnchorEstimate,
    DecisionOutcome,
    GraphEstimate,
    StationEstimate,
    Status,
)
from slam_uwb.model.survey import Decision


def link(station, anchor, rejection=None):
    return LinkMeasurement(station, anchor, 3.0, 3.0, 0.1, 10, rejection=rejection)


@pytest.fixture
def estimate():
    return GraphEstimate(
        stations=(
            StationEstimate("a", Pose2(1.0, 2.0, 0.0), np.eye(3), Status.OK),
            StationEstimate("b", None, None, Status.DISCONNECTED),
        ),
        anchors=tuple(
            AnchorEstimate(name, None, None, None, 9, Status.UNREACHABLE) for name in ("A", "B")
        ),
        links=(),
        frame="a",
    )


def test_poses_are_those_of_stations_that_have_a_place(estimate):
    assert estimate.poses == {"a": Pose2(1.0, 2.0, 0.0)}


def test_anchors_count_the_links_that_are_used(estimate):
    links = (link("a", "A"), link("b", "A", "a fault"), link("c", "A"), link("b", "B", "a fault"))
    changed = estimate.with_links(links)
    assert changed.links == links
    assert [anchor.stations for anchor in changed.anchors] == [2, 0]
    assert changed.stations == estimate.stations


def test_a_decision_that_nothing_contradicts_is_no_warning():
    assert DecisionOutcome(Decision("pair", "a", "b", "keep"), "used").warning is None


def test_a_contradiction_is_told_with_the_decision_and_what_was_done():
    outcome = DecisionOutcome(Decision("pair", "a", "b", "keep"), "used", "the scans disagree")
    assert outcome.warning == "decisions.csv: pair a, b: keep, used, although the scans disagree"


def test_corners_enclose_just_the_cells_that_were_seen():
    occupancy = np.full((4, 6), np.nan)
    occupancy[1, 2] = 0.1
    occupancy[2, 4] = 0.9
    # Cells of half a metre from (-1, 2) on: columns 2 to 4 end at x = 0 and 1.5, rows 1 to 2 at y = 2.5 and 3.5.
    corners = FloorMap(occupancy, 0.5, (-1.0, 2.0)).seen_corners
    assert corners.tolist() == [[0.0, 2.5], [1.5, 3.5]]


@pytest.mark.parametrize("shape", [(0, 0), (3, 3)])
def test_a_map_of_the_unknown_has_no_corners(shape):
    assert FloorMap(np.full(shape, np.nan), 0.05, (0.0, 0.0)).seen_corners.shape == (0, 2)


def test_cells_are_free_or_occupied_or_neither():
    floor = FloorMap(np.array([[0.1, 0.5, 0.9, np.nan]]), 0.05, (0.0, 0.0))
    assert floor.free.tolist() == [[True, False, False, False]]
    assert floor.occupied.tolist() == [[False, False, True, False]]
