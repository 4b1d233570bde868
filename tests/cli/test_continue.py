"""A station recorded later is added to a solution, and the operator is told what moved."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from slam_uwb import read_solution, read_survey, write_survey


@pytest.fixture(scope="module")
def before(run, pristine_survey, tmp_path_factory):
    """The flat without its last station: survey and solution."""
    folder = tmp_path_factory.mktemp("before")
    survey = read_survey(pristine_survey)
    *stations, last = survey.stations
    less = replace(
        survey,
        stations=tuple(stations),
        ranges=tuple(item for item in survey.ranges if item.station != last.id),
        sequence=tuple(pair for pair in survey.sequence if last.id not in pair),
    )
    write_survey(less, folder / "survey")
    write_survey(survey, folder / "grown")
    assert run("solve", folder / "survey", "--out", folder / "out").returncode == 0
    return folder


def test_a_station_is_added_and_the_moves_are_told(run, before, tmp_path):
    done = run("solve", before / "grown", "--continue", before / "out", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    line = next(line for line in done.stdout.splitlines() if line.startswith("continued"))
    assert "with s10 added: anchors moved by up to 0." in line
    document = json.loads((tmp_path / "out" / "solution.json").read_text())
    assert document["continued"]["added"] == ["s10"]
    old = json.loads((before / "out" / "solution.json").read_text())
    assert document["continued"]["checksum"] == old["checksum"] != document["checksum"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Continued from an earlier solution with s10 added" in page
    assert '<section id="moves">' in page
    # The page is drawn again from the folder alone, moves included.
    assert read_solution(tmp_path / "out").continued.added == ("s10",)


def test_the_folder_may_be_the_one_that_is_continued(run, before, tmp_path):
    out = tmp_path / "out"
    assert run("solve", before / "survey", "--out", out).returncode == 0
    done = run("solve", before / "grown", "--continue", out, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["continued"]
    assert told["added"] == ["s10"]
    assert {move["kind"] for move in told["moves"]} == {"station", "anchor"}


def test_its_settings_are_kept(run, before, tmp_path):
    out = tmp_path / "out"
    done = run("solve", before / "survey", "--out", out, "--mode", "sequential")
    assert done.returncode == 0, done.stderr
    done = run("solve", before / "grown", "--continue", out, "--out", out)
    assert done.returncode == 0, done.stderr
    assert json.loads((out / "solution.json").read_text())["mode"] == "sequential"


def test_what_has_changed_is_refused_and_nothing_written(run, before, tmp_path, contents):
    was = contents(before / "out")
    document = json.loads((before / "out" / "solution.json").read_text())
    document["software_version"] = "0.0.1"
    document["scans"][0]["ranges_m"][10] = 1.0
    spoilt = tmp_path / "spoilt"
    spoilt.mkdir()
    (spoilt / "solution.json").write_text(json.dumps(document))
    done = run("solve", before / "grown", "--continue", spoilt, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "solved by version 0.0.1" in done.stderr
    assert "the scan of s01 has changed" in done.stderr
    assert "solve without --continue" in done.stderr
    assert not (tmp_path / "out").exists()
    missing = run("solve", before / "grown", "--continue", tmp_path / "no", "--out", tmp_path / "o")
    assert missing.returncode == 2
    assert "no such folder" in missing.stderr
    assert contents(before / "out") == was


def test_an_ordinary_solution_was_not_continued(run, before):
    document = json.loads((before / "out" / "solution.json").read_text())
    assert document["continued"] is None
    assert '<section id="moves">' not in (before / "out" / "report.html").read_text()
