"""What the operator does with a solution: export it, plan from it, align it; from its folder alone."""

from __future__ import annotations

import csv
import json
import math
import shutil


def test_exports_are_written_beside_the_solution(run, solution, tmp_path, contents):
    before = contents(solution)
    done = run("export", solution, "--to", "dxf,ros", "--to", "csv")
    assert done.returncode == 0, done.stderr
    folder = solution.with_name(f"{solution.name}-export")
    assert {path.name for path in folder.iterdir()} == {
        "floor.dxf",
        "map.pgm",
        "map.yaml",
        "anchors_xyz.csv",
    }
    assert contents(solution) == before
    # Written again over what is there, to a folder of one's own.
    assert (
        run("export", solution, "--to", "tum", "--folder", tmp_path / "new" / "place").returncode
        == 0
    )
    assert (tmp_path / "new" / "place" / "stations.tum").is_file()


def test_an_unknown_format_is_refused_and_nothing_written(run, solution):
    done = run("export", solution, "--to", "dxf,shp")
    assert done.returncode == 2
    assert "shp: no such format" in done.stderr
    assert not solution.with_name(f"{solution.name}-export").exists()


def test_anchors_that_are_left_out_are_named(run, solution):
    document = json.loads((solution / "solution.json").read_text())
    document["anchors"][0]["status"] = "mirror-ambiguous"
    (solution / "solution.json").write_text(json.dumps(document))
    done = run("export", solution, "--to", "csv")
    assert done.returncode == 0
    assert f"left out, since their places are not ok: {document['anchors'][0]['id']}" in done.stderr


def test_plan_suggests_places_on_the_floor(run, solution):
    done = run("plan", solution, "--count", 2, "--json")
    assert done.returncode == 0, done.stderr
    places = json.loads(done.stdout)
    assert len(places) == 2
    assert all(0.0 < p["anchors_after_m"] < p["anchors_before_m"] for p in places)
    text = run("plan", solution, "--count", 2).stdout
    assert f"1. x {places[0]['x_m']:.2f} m" in text


def anchors(folder):
    with (folder / "anchors.csv").open(encoding="utf-8", newline="") as stream:
        return {
            row["anchor"]: (float(row["x_m"]), float(row["y_m"])) for row in csv.DictReader(stream)
        }


def test_align_by_known_places_moves_every_output(
    run, pristine_survey, pristine_solution, tmp_path
):
    """Two anchors put where they are in a frame turned by 90 degrees: the others follow."""
    old = anchors(pristine_solution)
    first, second, *rest = sorted(old)
    site = {name: (100.0 - y, 50.0 + x) for name, (x, y) in old.items()}
    points = [f"--align={name}={site[name][0]},{site[name][1]}" for name in (first, second)]
    done = run("solve", pristine_survey, "--out", tmp_path / "out", *points)
    assert done.returncode == 0, done.stderr
    new = anchors(tmp_path / "out")
    for name in rest:
        assert math.dist(new[name], site[name]) < 0.01
    document = json.loads((tmp_path / "out" / "solution.json").read_text())
    assert abs(document["alignment"]["theta_rad"] - math.pi / 2) < 1e-3
    x, y = document["floor_map"]["origin_m"]
    assert x > 80.0
    assert y > 30.0


def marked(folder, old):
    """A plan of 20 m by 25 m drawn at 40 pixels a metre, x to the right, with two anchors marked."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", (800, 1000), "white")
    ImageDraw.Draw(image).rectangle([100, 100, 700, 900], outline="black", width=6)
    image.save(folder / "plan.png")
    first, second, *_ = sorted(old)
    # World (x, y) drawn at (x + 8, y + 12) m from the lower left corner, rows counted from above.
    return {
        name: (40.0 * (old[name][0] + 8.0), 1000.0 - 40.0 * (old[name][1] + 12.0))
        for name in (first, second)
    }


def test_align_to_two_points_of_a_picture(run, pristine_survey, pristine_solution, tmp_path):
    """The whole survey stands where the picture has it, and the report shows the picture."""
    old = anchors(pristine_solution)
    points = [f"--align={name}={x},{y}" for name, (x, y) in marked(tmp_path, old).items()]
    picture = f"--align={tmp_path / 'plan.png'}"
    done = run("solve", pristine_survey, "--out", tmp_path / "out", picture, *points)
    assert done.returncode == 0, done.stderr
    assert "in the frame that --align asks for" in done.stdout
    new = anchors(tmp_path / "out")
    for name, (x, y) in old.items():
        assert math.dist(new[name], (x + 8.0, y + 12.0)) < 0.01
    document = json.loads((tmp_path / "out" / "solution.json").read_text())
    assert abs(document["alignment"]["x_m"] - 8.0) < 0.01
    given = document["picture"]
    assert abs(given["width"] * given["resolution_m"] - 20.0) < 0.02
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<g data-layer="given">' in page
    assert "the plan given" in page
    assert run("report", tmp_path / "out").returncode == 0


def test_a_bad_picture_is_refused(run, pristine_survey, tmp_path):
    marked(tmp_path, {"A1": (0.0, 0.0), "A2": (1.0, 1.0)})
    plan, text = tmp_path / "plan.png", tmp_path / "text.png"
    text.write_text("no picture")
    cases = (
        ((plan, "A1=10,10"), "two points are needed"),
        ((plan, "A1=10,10", "A2=10,2000"), "A2=10,2000 is not in the picture of 800 x 1000 pixels"),
        ((text, "A1=10,10", "A2=10,20"), "is no picture that can be read"),
        ((plan, text, "A1=10,10"), "one picture at most"),
        ((tmp_path / "none.png", "A1=10,10"), "none.png': expected"),
    )
    for words, message in cases:
        options = [f"--align={word}" for word in words]
        done = run("solve", pristine_survey, "--out", tmp_path / "out", *options)
        assert done.returncode == 2, done.stdout
        assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_bad_alignment_is_refused(run, pristine_survey, tmp_path):
    for word in ("wals", "A1=3", "A1=3,north", "=1,2"):
        done = run("solve", pristine_survey, "--out", tmp_path / "out", "--align", word)
        assert done.returncode == 2, done.stdout
        assert "--align" in done.stderr
    assert not (tmp_path / "out").exists()


def test_the_survey_is_not_needed(run, survey, tmp_path):
    assert run("solve", survey, "--out", tmp_path / "out").returncode == 0
    shutil.rmtree(survey)
    for words in (("report",), ("plan",), ("export", "--to", "dxf,g2o,pyfg,svg,geojson,ply")):
        command, *options = words
        assert run(command, tmp_path / "out", *options).returncode == 0


def test_a_report_into_no_folder_names_the_folder(run, pristine_solution, tmp_path):
    done = run("report", pristine_solution, "--to", tmp_path / "none" / "page.html")
    assert done.returncode == 2
    assert done.stderr == f"slam-uwb: {tmp_path / 'none'}: no such folder\n"
