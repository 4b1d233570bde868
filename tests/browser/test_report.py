"""The report as a person uses it: in a browser, from the disk, without a network."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from slam_uwb.io import read_survey
from slam_uwb.pipeline import solve_survey
from slam_uwb.report.page import draw_report

FLAT = Path(__file__).parents[2] / "datasets" / "flat"
HOSTILE = "<script>document.title = 'owned'; alert(1)</script><img src=x onerror=alert(2)>"


@pytest.fixture(scope="module")
def solution():
    return solve_survey(read_survey(FLAT))


@pytest.fixture(scope="module")
def report(solution, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(draw_report(solution), encoding="utf-8")
    return path


def column(page, table, number):
    cells = page.locator(f"#{table} tbody tr:visible td:nth-child({number})")
    return cells.all_inner_texts()


def view(page):
    return [float(v) for v in page.locator("#plan").get_attribute("viewBox").split()]


def test_it_opens_without_a_complaint(open_page, report, solution):
    page = open_page(report)
    assert page.problems == []
    assert page.locator(".badge").inner_text().strip()
    assert page.locator(".mark.station:visible").count() == len(solution.stations)
    assert page.locator(".mark.anchor:visible").count() == len(solution.anchors)


def test_a_survey_named_like_a_script_does_nothing(open_page, solution, tmp_path):
    path = tmp_path / "report.html"
    hostile = replace(solution, survey_name=HOSTILE, warnings=(HOSTILE,))
    path.write_text(draw_report(hostile), encoding="utf-8")
    page = open_page(path)
    page.wait_for_timeout(100)
    assert page.problems == []
    assert page.locator("h1").inner_text() == HOSTILE
    assert page.title().startswith("<script>")


def test_its_own_policy_stops_what_would_get_through(open_page, report, tmp_path):
    """Even markup that no escaping caught would not run."""
    path = tmp_path / "report.html"
    text = report.read_text(encoding="utf-8")
    path.write_text(text.replace("<main>", f"<main>{HOSTILE}"), encoding="utf-8")
    page = open_page(path)
    page.wait_for_timeout(100)
    assert "dialog" not in page.problems
    assert page.title() != "owned"


@pytest.mark.parametrize(
    ("layer", "shown"),
    [("stations", True), ("anchors", True), ("ovals", True), ("free", False), ("matches", False)],
)
def test_layers_switch(open_page, report, layer, shown):
    page = open_page(report)
    group = page.locator(f'#plan g[data-layer="{layer}"]')
    assert group.is_visible() == shown
    page.set_checked(f'input[data-layer="{layer}"]', not shown)
    assert group.is_visible() != shown
    page.set_checked(f'input[data-layer="{layer}"]', shown)
    assert group.is_visible() == shown
    assert page.problems == []


def overlapping(page):
    """Pairs of texts on the map of which one covers the other by more than a hair."""
    return page.evaluate("""() => {
      const shown = [...document.querySelectorAll("#plan .name")].filter((t) => t.getClientRects().length);
      const boxes = shown.map((t) => [t.textContent, t.getBoundingClientRect()]);
      const pairs = [];
      boxes.forEach(([name, a], k) => boxes.slice(k + 1).forEach(([other, b]) => {
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide > 1.5 && high > 4) pairs.push(`${name} ${other}`);
      }));
      return pairs;
    }""")


@pytest.mark.parametrize("width", [1400, 390, 320])
def test_no_name_leaves_the_frame(open_page, report, width):
    page = open_page(report, width=width, height=900)
    page.wait_for_timeout(100)
    cut = page.evaluate("""() => {
      const frame = document.querySelector("#plan").getBoundingClientRect();
      return [...document.querySelectorAll("#plan .mark .name")].filter((name) => {
        const box = name.getBoundingClientRect();
        return box.width && (box.left < frame.left - 1 || box.right > frame.right + 1);
      }).map((name) => name.textContent);
    }""")
    assert cut == []


@pytest.mark.parametrize("width", [1400, 390])
def test_names_and_areas_do_not_cover_each_other(open_page, report, solution, width):
    page = open_page(report, width=width, height=900)
    page.wait_for_timeout(100)
    assert overlapping(page) == []
    named = page.locator("#plan .mark .name:visible").count()
    assert named >= len(solution.stations) + len(solution.anchors)
    # What had no room comes back where there is some.
    areas = page.locator("#plan .room:visible").count()
    for _ in range(2):
        page.click('[data-zoom="in"]')
    page.wait_for_timeout(100)
    assert overlapping(page) == []
    assert page.locator("#plan .room:visible").count() >= areas


def test_a_layer_without_content_has_no_box(open_page, report, solution):
    assert all(link.rejection is None for link in solution.links)
    page = open_page(report)
    assert page.locator('input[data-layer="rejected"]').count() == 0
    assert page.locator('input[data-layer="free"]').count() == 1


def test_tables_sort_by_number_and_by_name(open_page, report, solution):
    page = open_page(report)
    sigma = page.locator("#anchors thead th").all_inner_texts().index("2 sigma") + 1
    head = page.locator(f"#anchors th:nth-child({sigma}) button")
    head.click()
    values = [float(v) for v in column(page, "anchors", sigma)]
    assert values == sorted(values)
    assert len(set(values)) > 1
    head.click()
    assert [float(v) for v in column(page, "anchors", sigma)] == sorted(values, reverse=True)
    assert head.locator("..").get_attribute("aria-sort") == "descending"
    page.locator("#stations th:nth-child(1) button").click()
    assert column(page, "stations", 1) == sorted(str(s.id) for s in solution.stations)


def test_residuals_sort_by_value_with_their_sign(open_page, report):
    page = open_page(report)
    place = page.locator("#links thead th").all_inner_texts().index("residual") + 1
    page.locator(f"#links th:nth-child({place}) button").click()
    values = [float(v) for v in column(page, "links", place) if v]
    assert values == sorted(values)
    assert values[0] < 0 < values[-1]


def test_hypotheses_that_are_not_used_come_on_demand(open_page, report, solution):
    page = open_page(report)
    used = sum(match.rejection is None for match in solution.matches)
    assert page.locator("#matches tbody tr:visible").count() == used
    page.check('input[data-more="matches"]')
    assert page.locator("#matches tbody tr:visible").count() == len(solution.matches)


def test_hovering_tells_values_and_lights_up_the_row(open_page, report, solution):
    page = open_page(report)
    anchor = solution.anchors[0].id
    assert page.locator("#tip").is_hidden()
    page.locator(f'.mark[data-key="anchor:{anchor}"] .sign').hover()
    assert f"anchor {anchor}" in page.locator("#tip").inner_text()
    assert page.locator("#anchors tr.lit td:first-child").all_inner_texts() == [anchor]
    page.locator("#anchors h2").hover()
    assert page.locator("#tip").is_hidden()


def test_hovering_a_row_lights_up_its_mark(open_page, report, solution):
    page = open_page(report)
    station = solution.stations[1].id
    page.locator(f'#stations tr[data-keys="station:{station}"]').hover()
    assert page.locator(".mark.lit").get_attribute("data-key") == f"station:{station}"


def test_the_map_zooms_about_the_pointer_and_moves(open_page, report):
    page = open_page(report)
    page.locator("#plan").scroll_into_view_if_needed()
    before = view(page)
    mark = page.locator(".mark.anchor .sign").first
    box = mark.bounding_box()
    at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*at)
    box = mark.bounding_box()  # a mark under the pointer has a thicker edge
    page.mouse.wheel(0, -300)
    page.wait_for_function(
        f"document.getElementById('plan').viewBox.baseVal.width < {before[2] * 0.9}"
    )
    after = mark.bounding_box()
    # What is under the pointer stays there, and marks keep their size.
    assert after["x"] + after["width"] / 2 == pytest.approx(at[0], abs=1.0)
    assert after["width"] == pytest.approx(box["width"], abs=0.5)
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(at[0] + 80, at[1] + 40, steps=4)
    page.mouse.up()
    moved = mark.bounding_box()
    assert moved["x"] - after["x"] == pytest.approx(80, abs=1.5)
    assert moved["y"] - after["y"] == pytest.approx(40, abs=1.5)
    page.click('[data-zoom="all"]')
    assert view(page) == before
    page.click('[data-zoom="in"]')
    assert view(page)[2] == pytest.approx(before[2] / 1.5)


def test_the_keyboard_moves_and_zooms(open_page, report):
    page = open_page(report)
    before = view(page)
    page.locator("#plan").focus()
    page.keyboard.press("+")
    assert view(page)[2] == pytest.approx(before[2] / 1.25)
    page.keyboard.press("ArrowRight")
    assert view(page)[0] > before[0]
    page.keyboard.press("0")
    assert view(page) == before


def test_the_scale_bar_is_as_long_as_it_says(open_page, report):
    page = open_page(report)
    for _ in range(3):
        bar = page.locator("#scale path").bounding_box()["width"]
        number, unit = page.locator("#scale text").text_content().split()
        picture = page.locator("#plan").bounding_box()
        units = max(view(page)[2] / picture["width"], view(page)[3] / picture["height"])
        assert bar * units == pytest.approx(float(number) * (100 if unit == "m" else 1), rel=0.05)
        page.click('[data-zoom="in"]')


@pytest.mark.parametrize("width", [320, 390])
def test_on_a_phone_nothing_but_tables_scrolls_sideways(open_page, report, width):
    page = open_page(report, width=width, height=780, has_touch=True, is_mobile=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.problems == []
    page.locator(".mark.anchor .sign").first.tap()
    assert "anchor" in page.locator("#tip").inner_text()


def test_on_a_phone_the_map_comes_before_its_layers(open_page, report):
    page = open_page(report, width=390, height=844)
    assert page.locator("#plan").bounding_box()["y"] < page.locator("#layers").bounding_box()["y"]


def test_two_fingers_zoom(open_page, report):
    page = open_page(report, width=390, height=780, has_touch=True, is_mobile=True)
    page.locator("#plan").scroll_into_view_if_needed()
    box = page.locator("#plan").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = page.context.new_cdp_session(page)
    before = view(page)

    def send(kind, *places):
        points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    send("touchStart", (x - 30, y), (x + 30, y))
    for step in range(1, 6):
        send("touchMove", (x - 30 - 6 * step, y), (x + 30 + 6 * step, y))
    send("touchEnd")
    # The fingers are twice as far apart.
    assert view(page)[2] == pytest.approx(before[2] / 2.0, rel=0.1)


def test_print_shows_all_rows_and_no_controls(open_page, report, solution):
    page = open_page(report)
    page.emulate_media(media="print")
    assert page.locator(".buttons").is_hidden()
    assert page.locator("nav").is_hidden()
    # A head that is a button would be printed on a table's first page only.
    assert (
        page.locator("th button").first.evaluate("b => getComputedStyle(b).display") == "contents"
    )
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.set_viewport_size({"width": 720, "height": 1000})
    bar, plan = (page.locator(name).bounding_box() for name in ("#scale path", "#plan"))
    assert plan["x"] < bar["x"]
    assert bar["y"] < plan["y"] + plan["height"]
    # No table is cut by a scrolling box.
    assert page.evaluate(
        "[...document.querySelectorAll('.scroll')].every((box) => box.scrollHeight <= box.clientHeight + 1)"
    )
    assert page.pdf(format="A4").startswith(b"%PDF")


def test_it_reads_without_scripts_too(open_page, report, solution):
    page = open_page(report, java_script_enabled=False)
    assert page.locator(".mark.anchor:visible").count() == len(solution.anchors)
    # Marks have a readable size.
    assert 5 < page.locator(".mark.station .sign").first.bounding_box()["width"] < 30


def test_colours_differ_in_lightness_or_shape_for_the_colour_blind():
    """Links are told apart by dashes, stations from anchors by shape: never by colour alone."""
    style = (
        Path(sys.modules["slam_uwb.report.page"].__file__).parent / "templates/report.css"
    ).read_text()
    rules = dict(part.split("{", 1) for part in style.split("}") if part.count("{") == 1)
    dashes = {
        kind: next(
            (v for name, v in rules.items() if name.strip() == f"line.{kind}"), ""
        ).partition("dasharray:")[2]
        for kind in ("free", "blocked", "rejected", "degenerate")
    }
    assert len(set(dashes.values())) == len(dashes)
