"""The picture of a solution: what is in it, where, and that it is always the same."""

import io
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import Ellipse
from PIL import Image

from slam_uwb.evaluate import evaluate_solution
from slam_uwb.model.floor import FloorMap
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import Alternative, AnchorEstimate, Solution, StationEstimate, Status
from slam_uwb.model.survey import Reference, ReferencePlace
from slam_uwb.report import draw_solution, figure_png

# 4 m x 3 m room in cells of 0.5 m: a wall round free space, unknown beyond.
ROOM = np.full((8, 10), np.nan)
ROOM[1:7, 1:9] = 0.99
ROOM[2:6, 2:8] = 0.05
FLOOR_MAP = FloorMap(ROOM, 0.5, (-0.5, -1.0))
REFERENCE_T_WORLD = Pose2(10.0, 20.0, math.pi / 2)

STATIONS = (
    StationEstimate("s1", Pose2(1.0, 0.5, 0.0), np.diag([0.04, 0.01, 0.001]), Status.OK),
    StationEstimate("s2", Pose2(2.0, 1.0, math.pi / 2), np.diag([0.04, 0.01, 0.001]), Status.OK),
    StationEstimate("s3", Pose2(3.0, 1.5, 1.0), None, Status.WEAK_GEOMETRY, heading_known=False),
    StationEstimate("s4", None, None, Status.DISCONNECTED),
)
ANCHORS = (
    AnchorEstimate("A", np.array([0.0, 0.0]), np.diag([0.01, 0.04]), 2.0, 3, Status.OK),
    AnchorEstimate("B", np.array([4.0, 0.0]), np.diag([0.01, 0.04]), 2.0, 3, Status.MIRROR_AMBIGUOUS,
                   (Alternative(4.0, 2.0, None, 0.4),)),
    AnchorEstimate("C", None, None, 2.0, 2, Status.AMBIGUOUS,
                   (Alternative(0.0, 2.0, None, 0.5), Alternative(1.0, 2.0, None, 0.5))),
    AnchorEstimate("D", np.array([90.0, 2.0]), np.eye(2) * 1e4, 2.0, 3, Status.WEAK_GEOMETRY),
)  # fmt: skip


def solution(stations=STATIONS, anchors=ANCHORS, floor_map=FLOOR_MAP):
    return Solution(
        survey_name="room", checksum="", mode="joint", settings=Settings(), software_version="0", frame="s1",
        stations=stations, anchors=anchors, matches=(), links=(), biases=(), joint_names=(),
        joint_covariance=None, checks=None, floor_map=floor_map, scans={},
    )  # fmt: skip


def reference():
    """Stations as solved; anchor A 0.3 m further along x of the world, and C."""
    stations = {s.id: REFERENCE_T_WORLD @ s.pose for s in STATIONS if s.pose}
    places = {"A": (0.3, 0.0), "C": (0.0, 2.1), "unknown": (math.nan, 0.0)}
    anchors = {name: REFERENCE_T_WORLD.transform(place) for name, place in places.items()}
    return Reference(
        {name: ReferencePlace(pose.x, pose.y, pose.theta) for name, pose in stations.items()},
        {name: ReferencePlace(*place) for name, place in anchors.items()},
    )


def lines(figure):
    return {line.get_label(): line.get_xydata() for line in figure.axes[0].lines}


def texts(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def ellipses(figure):
    return [patch for patch in figure.axes[0].patches if isinstance(patch, Ellipse)]


def test_every_thing_with_a_place_is_drawn_there_by_status():
    drawn = lines(draw_solution(solution()))
    np.testing.assert_allclose(drawn["station"], [(1.0, 0.5), (2.0, 1.0)])
    np.testing.assert_allclose(drawn["station, weak-geometry"], [(3.0, 1.5)])
    np.testing.assert_allclose(drawn["anchor"], [(0.0, 0.0)])
    np.testing.assert_allclose(drawn["anchor, mirror-ambiguous"], [(4.0, 0.0)])
    np.testing.assert_allclose(drawn["anchor, other place not excluded"], [(4, 2), (0, 2), (1, 2)])


def test_what_is_not_ok_looks_different_and_is_in_the_legend():
    figure = draw_solution(solution())
    filling = {line.get_label(): line.get_fillstyle() for line in figure.axes[0].lines}
    assert filling["station"] == filling["anchor"] == "full"
    assert filling["station, weak-geometry"] == "none"
    assert filling["anchor, mirror-ambiguous"] == "left"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert set(filling) <= set(legend)
    assert {"station, 2 sigma", "anchor, 2 sigma"} <= set(legend)
    assert len(legend) == len(set(legend))


def test_what_is_not_in_the_picture_is_named_below():
    below = draw_solution(solution()).axes[0].get_xlabel()
    assert "without a place: s4 (disconnected), C (ambiguous)" in below
    assert "outside the picture: D at (90.0, 2.0)" in below
    assert draw_solution(solution(STATIONS[:2], ANCHORS[:1])).axes[0].get_xlabel() == "x / m"


def test_ellipses_hold_two_sigmas_in_the_worlds_axes():
    # s1: sigmas 0.2 along its x and 0.1 across, so full axes of 0.8 and 0.4 m; s2 looks along y: turned by 90.
    s1, s2, a, *_ = ellipses(draw_solution(solution()))
    for ellipse, long_axis in ((s1, 0.0), (s2, 90.0), (a, 90.0)):
        axes = {0: ellipse.width, 90: ellipse.height}
        assert sorted(axes.values()) == pytest.approx([0.4, 0.8])
        longest = max(axes, key=axes.get)
        assert math.sin(math.radians(ellipse.angle + longest - long_axis)) == pytest.approx(
            0.0, abs=1e-9
        )
    assert s2.center == pytest.approx((2.0, 1.0))


def test_an_unusable_covariance_draws_no_ellipse():
    anchors = (
        AnchorEstimate("A", np.zeros(2), np.full((2, 2), math.nan), 2.0, 3, Status.OK),
        AnchorEstimate("B", np.ones(2), np.zeros((2, 2)), 2.0, 3, Status.OK),
    )
    (ellipse,) = ellipses(draw_solution(solution((), anchors)))
    assert (ellipse.width, ellipse.height) == (0.0, 0.0)


def test_headings_are_ticks_where_they_are_known():
    collections = figure_segments(draw_solution(solution(anchors=())))
    (ticks,) = [segments for segments in collections if len(segments)]
    assert len(ticks) == 2
    for tick, way in zip(ticks, [(1.0, 0.0), (0.0, 1.0)], strict=True):
        along = (tick[1] - tick[0]) / np.linalg.norm(tick[1] - tick[0])
        np.testing.assert_allclose(along, way, atol=1e-9)


def figure_segments(figure):
    return [c.get_segments() for c in figure.axes[0].collections if isinstance(c, LineCollection)]


def test_the_reference_is_brought_into_the_world():
    figure = draw_solution(solution(), reference=reference())
    np.testing.assert_allclose(
        lines(figure)["anchor, reference"], [(0.3, 0.0), (0.0, 2.1)], atol=1e-9
    )
    errors = next(c for c in figure.axes[0].collections if c.get_label() == "error")
    np.testing.assert_allclose(errors.get_segments(), [[(0.3, 0.0), (0.0, 0.0)]], atol=1e-9)
    assert {"A: 0.30 m", "B", "C", "C?", "s1"} <= set(texts(figure))
    title = figure.axes[0].get_title()
    assert "room, joint" in title
    assert "anchors RMSE 0.300 m (1 ok of 2)" in title


def test_an_evaluation_that_is_given_is_used():
    given = evaluate_solution(solution(), reference())
    with_it = draw_solution(solution(), reference=reference(), evaluation=given)
    assert figure_png(with_it) == figure_png(draw_solution(solution(), reference=reference()))
    # Without the reference itself there are errors in the names but no crosses.
    alone = draw_solution(solution(), evaluation=given)
    assert "A: 0.30 m" in texts(alone)
    assert "anchor, reference" not in lines(alone)


def test_a_reference_that_does_not_fit_is_said_and_not_drawn():
    nothing = Reference({}, {"A": ReferencePlace(0.0, 0.0)})
    figure = draw_solution(solution(), reference=nothing)
    assert "cannot be compared" in figure.axes[0].get_title()
    assert "anchor, reference" not in lines(figure)


def test_floor_map_greys_and_place():
    figure = draw_solution(solution())
    (image,) = figure.axes[0].get_images()
    grey = np.asarray(image.get_array())
    assert grey[3, 3] == 1.0  # free
    assert grey[1, 1] < 0.2  # wall
    assert 0.8 < grey[0, 0] < 0.95  # unknown
    assert image.origin == "lower"
    assert image.get_extent() == pytest.approx([-0.5, 4.5, -1.0, 3.0])
    assert "2 of 4 stations and 1 of 4 anchors ok" in figure.axes[0].get_title()


def test_one_far_anchor_does_not_shrink_the_map():
    near = draw_solution(solution(anchors=ANCHORS[:3])).axes[0].axis()
    assert draw_solution(solution()).axes[0].axis() == pytest.approx(near)
    # One that is sure belongs to the picture, wherever it is.
    sure = AnchorEstimate("E", np.array([90.0, 2.0]), np.eye(2), 2.0, 3, Status.OK)
    assert draw_solution(solution(anchors=(sure,))).axes[0].get_xlim()[1] > 90.0


def test_metres_are_as_long_in_x_as_in_y():
    figure = draw_solution(solution())
    figure.draw_without_rendering()
    x, y = (
        figure.axes[0].transData.transform([(1.0, 1.0)])[0]
        - figure.axes[0].transData.transform([(0.0, 0.0)])[0]
    )
    assert x == pytest.approx(y, rel=1e-6)


def test_names_do_not_cover_each_other():
    random = np.random.default_rng(4)
    # A dense cluster: 12 stations within 1.5 m x 1.5 m of a 4 m room.
    stations = tuple(
        StationEstimate(f"s{k:02d}", Pose2(*random.uniform(0.5, 2.0, 2), 0.0), None, Status.OK)
        for k in range(12)
    )
    figure = draw_solution(solution(stations))
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 12 + 2 + 3
    overlaps = [(a, b) for k, a in enumerate(boxes) for b in boxes[k + 1 :] if a.overlaps(b)]
    assert not overlaps
    frame = figure.axes[0].get_window_extent()
    assert all(frame.contains(*box.min) and frame.contains(*box.max) for box in boxes)


def test_hundreds_of_stations_are_not_named_but_those_that_need_attention():
    many = tuple(
        StationEstimate(f"n{k}", Pose2(0.1 * k, 0.0, 0.0), None, Status.OK) for k in range(300)
    )
    weak = StationEstimate("look", Pose2(3.0, 2.0, 0.0), None, Status.WEAK_GEOMETRY)
    assert texts(draw_solution(solution((*many, weak), ()))) == ["look"]


EMPTY_MAP = FloorMap(np.empty((0, 0)), 0.05, (0.0, 0.0))
UNKNOWN_MAP = FloorMap(np.full((3, 3), np.nan), 0.05, (0.0, 0.0))


@pytest.mark.parametrize(
    ("floor_map", "stations", "anchors"),
    [
        (None, (), ()),
        (EMPTY_MAP, STATIONS[3:], ANCHORS[2:3]),
        (UNKNOWN_MAP, STATIONS[:1], ()),
        (FLOOR_MAP, (), ()),
        (None, STATIONS[2:3], ()),
        (None, (), ANCHORS[3:]),
        (EMPTY_MAP, STATIONS[:1], ANCHORS[3:]),
    ],
)
def test_any_part_may_be_missing(floor_map, stations, anchors):
    figure = draw_solution(solution(stations, anchors, floor_map))
    left, right, bottom, top = figure.axes[0].axis()
    assert left < right < 200.0
    assert bottom < top


def test_png_is_the_same_each_time_and_tells_no_version():
    first, second = (figure_png(draw_solution(solution(), reference=reference())) for _ in range(2))
    assert first == second
    with Image.open(io.BytesIO(first)) as image:
        assert image.format == "PNG"
        assert set(image.info) <= {"dpi"}
        assert min(image.size) > 600


@pytest.mark.parametrize("wide", [True, False])
def test_no_side_of_the_picture_is_an_empty_strip(wide):
    """A floor much longer than wide, and one much wider than long: axes keep the proportions of either."""
    cells = np.full((30, 400), 0.05)
    floor_map = FloorMap(cells if wide else cells.T, 0.05, (0.0, 0.0))
    drawn = figure_png(draw_solution(solution(STATIONS[:2], (), floor_map)))
    with Image.open(io.BytesIO(drawn)) as image:
        inked = np.asarray(image.convert("L")) < 250
    for rows in (inked, inked[::-1], inked.T, inked.T[::-1]):
        # Pixels before the first that is not white: 0.08 in at 150 dots an inch are 12.
        assert int(rows.any(axis=1).argmax()) <= 16


def test_a_name_is_text_and_no_formula():
    named = replace(solution((), ()), survey_name="$\\frac$ room" + " very long" * 50)
    figure = draw_solution(named)
    figure_png(figure)
    title = figure.axes[0].get_title()
    assert title.startswith("$\\frac$ room very long")
    assert len(title) < 100


def test_pyplot_is_never_loaded():
    code = "import sys, slam_uwb.report; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
