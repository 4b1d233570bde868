"""The picture of a comparison: a bar a method, a curve a mode."""

import pytest

from slam_uwb.evaluate import MethodResult
from slam_uwb.report import draw_comparison, figure_png

RESULTS = (
    MethodResult("a$b", "joint, x", "joint", "x", "y", 3, 3, 0.1, 2, 2, 0.3, 0.4, (0.2, 0.4)),
    MethodResult("a$b", "seq, x", "sequential", "x", "y", 3, 3, 0.1, 2, 1, 0.5, 0.5, (0.5,)),
    MethodResult("c", "joint, x", "joint", "x", "y", 3, 0, failure="no two stations"),
)


def test_bars_and_curves_are_the_figures():
    figure = draw_comparison(RESULTS)
    bars, curves, failed, empty = figure.axes
    assert [bar.get_width() for bar in bars.patches] == [0.3, 0.5]
    assert [label.get_text() for label in bars.get_yticklabels()] == ["joint, x", "seq, x"]
    # Two errors: half the share at 0.2, all at 0.4.
    joint = curves.lines[0]
    assert list(joint.get_xdata()) == [0.2, 0.4]
    assert list(joint.get_ydata()) == [0.5, 1.0]
    assert "no two stations" in failed.texts[0].get_text()
    assert not empty.lines


@pytest.mark.parametrize("results", [(), RESULTS[2:], RESULTS])
def test_it_is_a_picture_and_always_the_same(results):
    first, second = (figure_png(draw_comparison(results)) for _ in range(2))
    assert first == second
    assert first.startswith(b"\x89PNG")
