"""``slam-uwb solve``: files, summary, refusals and exit statuses."""

import csv
import json
import re
import shutil
from dataclasses import replace

import pytest

from slam_uwb.io import read_survey, write_survey

FILES = {
    *("anchors.csv", "stations.csv", "alternatives.csv", "links.csv", "matches.csv"),
    *("solution.json", "map.png", "map.yaml", "settings.toml", "figure.png", "report.html"),
}


def rows(folder, name):
    with (folder / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_writes_a_complete_solution(pristine_solution, contents):
    assert {*contents(pristine_solution)} == FILES
    assert len(rows(pristine_solution, "stations.csv")) == 10
    assert len(rows(pristine_solution, "anchors.csv")) == 5
    assert (pristine_solution / "figure.png").read_bytes().startswith(b"\x89PNG")
    leftovers = [path for path in pristine_solution.parent.iterdir() if path != pristine_solution]
    assert leftovers == []


def test_summary_agrees_with_the_tables(run, survey, contents):
    # A new folder within the survey is a fine place too, as long as the survey stays what it was.
    before = contents(survey)
    out = survey / "new" / "out"
    done = run("solve", survey, "--out", out)
    assert done.returncode == 0, done.stderr
    for kind in ("stations", "anchors"):
        items = rows(out, f"{kind}.csv")
        ok, everything = map(int, re.search(rf"{kind}\s+(\d+) of (\d+) ok", done.stdout).groups())
        assert everything == len(items)
        assert ok == sum(item["status"] == "ok" for item in items)
        for item in items:
            named = re.search(rf"{item['status']}: .*\b{item[kind[:-1]]}\b", done.stdout)
            assert bool(named) == (item["status"] != "ok")
    assert str(out / "figure.png") in done.stdout
    # No progress bar and no colours where nobody looks on.
    assert [line for line in done.stderr.splitlines() if not line.startswith("warning: ")] == []
    assert "\x1b" not in done.stdout + done.stderr
    assert before.items() <= contents(survey).items()
    assert run("check", survey).returncode == 0


def test_json_summary(run, pristine_survey, tmp_path):
    out = tmp_path / "out"
    done = run("solve", pristine_survey, "--out", out, "--json", "--no-ranges")
    summary = json.loads(done.stdout)
    assert done.returncode == 0
    assert (summary["survey"], summary["mode"]) == ("flat-1", "joint")
    assert summary["stations"]["all"] == 10
    # Nothing says where an anchor is without ranges.
    assert summary["anchors"]["ok"] == 0
    assert sorted(name for names in summary["anchors"]["not_ok"].values() for name in names) == [
        row["anchor"] for row in rows(out, "anchors.csv")
    ]
    assert summary["figure"] == str(out / "figure.png")


def test_options_reach_the_settings(run, pristine_survey, tmp_path):
    out = tmp_path / "out"
    done = run(
        *("solve", pristine_survey, "--out", out),
        *("--mode", "sequential", "--pairs", "sequence", "--settings", "paper"),
    )
    assert done.returncode == 0, done.stderr
    settings = (out / "settings.toml").read_text()
    for line in ('mode = "sequential"', 'pairs = "sequence"', 'refiner = "paper_lm"'):
        assert line in settings


def test_a_settings_file_holds_unless_an_option_says_otherwise(run, pristine_survey, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[graph]\nmode = "sequential"\n[mapping]\nresolution_m = 0.1\n')
    out = tmp_path / "out"
    done = run("solve", pristine_survey, "--out", out, "--settings", file, "--mode", "joint")
    assert done.returncode == 0, done.stderr
    settings = (out / "settings.toml").read_text()
    for line in ('mode = "joint"', "resolution_m = 0.1"):
        assert line in settings.splitlines()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[graph]\nmdoe = 'joint'\n", "graph.mdoe"),
        ("[mapping]\nresolution_m = -1.0\n", "mapping.resolution_m"),
        ("[graph\n", "mine.toml"),
        (None, "mine.toml"),
    ],
)
def test_wrong_settings_end_with_2_and_name_the_key(run, pristine_survey, tmp_path, text, named):
    file = tmp_path / "mine.toml"
    if text is not None:
        file.write_text(text)
    done = run("solve", pristine_survey, "--out", tmp_path / "out", "--settings", file)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert named in done.stderr
    assert not (tmp_path / "out").exists()


def test_an_old_solution_is_replaced_as_a_whole(run, pristine_survey, solution, pristine_solution):
    (solution / "stations.csv").write_text("older")
    (solution / "leftover.csv").write_text("of an older version")
    assert run("solve", pristine_survey, "--out", solution).returncode == 0
    assert {path.name for path in solution.iterdir()} == FILES
    fresh = (pristine_solution / "stations.csv").read_bytes()
    assert (solution / "stations.csv").read_bytes() == fresh


@pytest.mark.parametrize(
    "place",
    [
        "notes",  # a folder with something in it, but no solution
        "file.txt",
        "flat",  # the survey itself
        ".",  # a folder that holds the survey
        "flat/scans",
        "flat/reference/out",
        "flat/survey.toml",
    ],
)
def test_refuses_what_it_would_destroy_before_any_work(run, survey, contents, place):
    base = survey.parent
    (base / "notes").mkdir()
    (base / "notes" / "todo.txt").write_text("mine")
    (base / "file.txt").write_text("mine")
    before = contents(base)
    done = run("solve", survey, "--out", base / place)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "--out" in done.stderr
    assert contents(base) == before


def test_a_future_reference_is_not_a_place_for_a_solution(run, survey):
    # Its stations.csv would be taken for the truth.
    shutil.rmtree(survey / "reference")
    assert run("solve", survey, "--out", survey / "reference").returncode == 2
    assert not (survey / "reference").exists()


def test_a_solution_with_a_survey_in_it_is_not_replaced(run, survey, solution, contents):
    shutil.copytree(survey, solution / "flat")
    before = contents(solution)
    for source in (survey, solution / "flat"):
        assert run("solve", source, "--out", solution).returncode == 2
    assert contents(solution) == before


def test_an_impossible_place_ends_with_2_before_any_work(run, survey, tmp_path):
    (tmp_path / "file.txt").write_text("mine")
    (survey / "survey.toml").write_text("would be a fault")
    done = run("solve", survey, "--out", tmp_path / "file.txt" / "out")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert f"{tmp_path / 'file.txt'} is no folder" in done.stderr


def test_what_cannot_be_solved_ends_with_3_and_says_why(run, pristine_survey, tmp_path):
    # One station and no control point: nothing for it to hold together with.
    whole = read_survey(pristine_survey)
    alone = replace(
        whole,
        stations=whole.stations[:1],
        ranges=tuple(link for link in whole.ranges if link.station == whole.stations[0].id),
        sequence=None,
    )
    write_survey(alone, tmp_path / "alone")
    done = run("solve", tmp_path / "alone", "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (3, "")
    reasons = [line for line in done.stderr.splitlines() if not line.startswith("warning: ")]
    assert len(reasons) == 1
    assert "cannot be solved" in reasons[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("fault", "remedy"),
    [
        ('ModuleNotFoundError("No module named \'open3d\'")', "pip install 'slam-uwb[open3d]'"),
        ('ImportError("libusb-1.0.so.0: cannot open shared object file")', "apt install libusb-1.0-0"),
        ('OSError("libGL.so.1: cannot open shared object file")', "apt install libgl1"),
    ],
)  # fmt: skip
def test_a_refiner_that_is_not_installed_ends_with_2_and_says_what_to_install(
    run, pristine_survey, tmp_path, monkeypatch, fault, remedy
):
    broken = tmp_path / "modules" / "open3d"
    broken.mkdir(parents=True)
    (broken / "__init__.py").write_text(f"raise {fault}\n")
    monkeypatch.setenv("PYTHONPATH", str(broken.parent))
    file, out = tmp_path / "settings.toml", tmp_path / "out"
    file.write_text('[matching]\nrefiner = "open3d"\n')
    done = run("solve", pristine_survey, "--out", out, "--settings", file)
    assert done.returncode == 2, done.stderr
    assert "'open3d'" in done.stderr
    assert remedy in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()
