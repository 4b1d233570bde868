"""Pictures of located tags: what is drawn where."""

import numpy as np
import pytest

from slam_uwb.model.floor import FloorMap
from slam_uwb.report import draw_distributions, draw_static_tags, draw_walk, figure_png

TRUTH = {"p1": np.array([0.0, 0.0]), "p2": np.array([4.0, 3.0])}
FOUND = {"p1": np.array([0.1, 0.2])}
MAP = FloorMap(np.full((20, 30), 0.1), 0.5, (-5.0, -4.0))


def test_static_tags_are_tied_to_where_they_lay():
    axes = draw_static_tags("office", TRUTH, {"found": FOUND}, MAP).axes[0]
    (ties,) = axes.collections
    np.testing.assert_array_equal(ties.get_segments(), [[[0.0, 0.0], [0.1, 0.2]]])
    labels = axes.get_legend_handles_labels()[1]
    assert labels == ["found", "true place"]
    # All of the map is in the picture.
    assert (axes.get_xlim(), axes.get_ylim()) == ((-5.0, 10.0), (-4.0, 6.0))


def test_a_walk_has_path_tracks_and_anchors():
    path = np.array([[0.0, 0.0], [5.0, 0.0]])
    track = np.array([[np.nan, np.nan], [1.0, 0.1], [2.0, 0.2]])
    axes = draw_walk("walk", path, {"a": track}, anchors={"a": np.array([[1.0, 4.0]])}).axes[0]
    assert axes.get_legend_handles_labels()[1] == ["path walked", "a", "a: anchors"]
    np.testing.assert_array_equal(axes.lines[1].get_xdata(), track[:, 0])


def test_distributions_name_their_medians():
    figure = draw_distributions({"static": {"a": [0.1, 0.3, 0.2, np.nan], "none": []}, "walk": {}})
    static, walk = figure.axes
    assert static.get_legend_handles_labels()[1] == ["a, median 0.20 m"]
    assert not walk.lines


@pytest.mark.parametrize(
    "draw",
    [
        lambda: draw_static_tags("$", {}, {}),
        lambda: draw_walk("_", None, {"a": np.full((3, 2), np.nan)}),
        lambda: draw_distributions({}),
        lambda: draw_distributions({"$x": {"a": [1.0]}}),
    ],
)
def test_nothing_is_a_picture_too_and_always_the_same(draw):
    assert figure_png(draw()) == figure_png(draw())
