"""The report's text: what it says of everything, that it needs nothing else, and that names stay text."""

import base64
import hashlib
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from slam_uwb.io import read_solution, write_solution
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import settings_from_mapping
from slam_uwb.model.solution import Status
from slam_uwb.report.page import draw_report
from slam_uwb.report.page_map import build_page_map
from slam_uwb.report.trust import judge_anchors


class Reader(HTMLParser):
    """Elements and the cells of the tables."""

    def __init__(self):
        super().__init__()
        self.tags, self.attributes, self.tables, self.at = [], [], {}, []
        self.table = None

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes.append((tag, dict(attributes)))
        self.at.append(tag)
        if tag == "section":
            self.table = dict(attributes).get("id")
        if tag == "tr":
            self.tables.setdefault(self.table, []).append([])
        if tag in ("td", "th"):
            self.tables[self.table][-1].append("")

    def handle_endtag(self, tag):
        while self.at and self.at.pop() != tag:
            pass

    def handle_data(self, data):
        if {"td", "th"} & set(self.at):
            self.tables[self.table][-1][-1] += data


def read(page):
    reader = Reader()
    reader.feed(page)
    return reader


def test_every_anchor_station_link_and_match_has_its_row(make_solution):
    tables = read(draw_report(make_solution())).tables
    assert [row[0] for row in tables["anchors"]] == ["anchor", "A", "B", "C"]
    assert [row[0] for row in tables["stations"]] == ["station", "s1", "s2", "s10", "s4"]
    assert len(tables["links"]) == 1 + 4 * 3
    assert len(tables["matches"]) == 1 + 2


def test_the_anchors_row_by_hand(make_solution):
    """Variances 0.0025 and 0.01: 2 sigma 0.20. Stations at -135, -26.6, 26.6, 135 degrees: 108.4 are free."""
    tables = read(draw_report(make_solution())).tables
    row = dict(zip(tables["anchors"][0], tables["anchors"][1], strict=True))
    assert row == {
        "anchor": "A", "verdict": "✓ trust", "x": "1.00", "y": "1.00", "height": "2.00", "2 sigma": "0.20",
        "links used": "4", "rejected": "0", "through walls": "0 %", "RMS": "0.01",
        "geometry": "all round (252°)", "status": "ok",
    }  # fmt: skip


def test_the_strength_of_a_match_by_direction(make_solution):
    """Sigmas of 1 mm along x and 30 mm along y of n."""
    tables = read(draw_report(make_solution())).tables
    row = dict(zip(tables["matches"][0], tables["matches"][1], strict=True))
    assert row["strength"] == "1.0 mm, 30.0 mm at 90°"
    assert row["residual"] == "0.000"
    corridor = replace(make_solution().matches[0], degenerate=True)
    assert "1.0 mm, free along 90°" in draw_report(make_solution(matches=(corridor,)))


HOSTILE = "<script>alert(1)</script>"


def test_names_are_text_and_never_markup(make_solution):
    quoted = f"{HOSTILE}\"'><img src=x onerror=alert(2)>{{{{ 7 * 7 }}}}"
    page = draw_report(make_solution(survey_name=quoted, warnings=(quoted,)))
    plain = draw_report(make_solution(survey_name="plain", warnings=("plain",)))
    # Nothing that the name brought along became an element.
    assert sorted(read(page).tags) == sorted(read(plain).tags)
    assert HOSTILE not in page
    assert "{{ 7 * 7 }}" in page


def test_names_in_attributes_stay_in_them(make_solution):
    station = replace(make_solution().stations[0], id='s" onmouseover="alert(1)')
    page = draw_report(make_solution(stations=(station, *make_solution().stations[1:])))
    assert not [a for _, a in read(page).attributes if "onmouseover" in a]


def test_it_needs_no_network_and_forbids_it(make_solution):
    page = draw_report(make_solution())
    addresses = [
        value for tag, a in read(page).attributes for name, value in a.items()
        if name in ("href", "src", "data", "action", "srcset")
    ]  # fmt: skip
    assert addresses
    assert all(value.startswith(("#", "data:image/png;base64,")) for value in addresses)
    assert not re.search(r"url\((?!#)|@import", page)
    policy = next(a["content"] for tag, a in read(page).attributes if "http-equiv" in a)
    assert policy.startswith("default-src 'none'; img-src data:;")


@pytest.mark.parametrize("element", ["style", "script"])
def test_the_policy_admits_its_own_style_and_script_alone(make_solution, element):
    page = draw_report(make_solution())
    (text,) = re.findall(f"<{element}>(.*?)</{element}>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    assert f"{element}-src 'sha256-{digest}'" in page
    # Attributes would need a policy that lets names of a survey run.
    assert not [
        a for _, a in read(page).attributes if "style" in a or any(k.startswith("on") for k in a)
    ]


def test_the_same_solution_gives_the_same_page_also_from_its_folder(make_solution, tmp_path):
    solution = make_solution()
    write_solution(solution, tmp_path / "out")
    # The map is kept in steps of 1/254, which greys do not show.
    assert draw_report(solution) == draw_report(solution)
    again = draw_report(read_solution(tmp_path / "out"))
    strip = re.compile(r"data:image/png;base64,[^\"]*")
    assert strip.sub("", again) == strip.sub("", draw_report(solution))


def test_y_goes_up_on_the_map(make_solution):
    """s10 at (3, 2) m is at (300, -200) of the picture, heading pi: half a turn; so is the wall of cell (1, 1)."""
    shown = build_page_map(make_solution(), judge_anchors(make_solution()))
    mark = next(item for item in shown.stations if item.name == "s10")
    assert (mark.x, mark.y, abs(mark.turn)) == (300.0, -200.0, 180.0)
    picture = shown.picture
    # 10 x 8 cells of 0.5 m from (-0.5, -1): x from -0.5 to 4.5, y up to 3.
    assert (picture.x, picture.y, picture.width, picture.height) == (-50.0, -300.0, 500.0, 400.0)
    image = Image.open(io.BytesIO(base64.b64decode(picture.data.partition(",")[2])))
    grey = np.asarray(image)
    # Row 0 is the top: unknown, then wall; the third column of the third row is free.
    assert grey[0, 0] == 226
    assert grey[1, 1] < 40
    assert grey[2, 2] == 255


def test_an_anchor_far_away_does_not_shrink_the_map(make_solution):
    solution = make_solution()
    far = replace(solution.anchors[0], position=np.array([900.0, 0.0]), status=Status.WEAK_GEOMETRY)
    far_map = build_page_map(
        make_solution(anchors=(far, *solution.anchors[1:])), judge_anchors(solution)
    )
    assert far_map.view == build_page_map(solution, judge_anchors(solution)).view


def test_ellipses_turn_with_the_covariance(make_solution):
    """Long axis at 45 degrees counter-clockwise is -45 in a picture whose y points down (or 135)."""
    anchor = replace(make_solution().anchors[0], covariance=np.array([[0.05, 0.04], [0.04, 0.05]]))
    solution = make_solution(anchors=(anchor,))
    oval = build_page_map(solution, judge_anchors(solution)).ovals[-1]
    # Variances 0.09 and 0.01: two sigmas of 0.6 and 0.2 m.
    assert (oval.rx, oval.ry) == (60.0, 20.0)
    assert oval.turn % 180.0 == pytest.approx(135.0)


def test_settings_that_differ_are_named(make_solution):
    page = draw_report(
        make_solution(settings=settings_from_mapping({"graph": {"mode": "sequential"}}))
    )
    assert "<dt>graph.mode</dt><dd>sequential (default joint)</dd>" in page
    assert "All settings are the defaults" in draw_report(make_solution())


def test_a_solution_of_nothing_has_its_page(make_solution):
    page = draw_report(
        make_solution(
            stations=(), anchors=(), links=(), matches=(), floor_map=None, checks=None, biases=()
        )
    )
    assert "0 of 0 stations placed" in page


def test_thousands_of_rows_are_cut_and_counted(make_solution):
    match = make_solution().matches[0]
    matches = tuple(replace(match, target_T_source=Pose2(k, 0.0, 0.0)) for k in range(3005))
    assert "5 more rows are in the solution's matches.csv" in draw_report(
        make_solution(matches=matches)
    )
