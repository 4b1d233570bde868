"""``slam-uwb position``."""

import csv
import json
import shutil

import pytest


@pytest.fixture(scope="module")
def office(run, tmp_path_factory):
    """A survey with its tags; the true anchors stand in reference/."""
    folder = tmp_path_factory.mktemp("office")
    done = run(
        *("simulate", "flat", "--seed", 1, "--duration-s", 4),
        *("--out", folder / "survey", "--tags", folder / "tags"),
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("kind", ["static", "walk"])
def test_found_and_true_anchors_side_by_side(run, office, pristine_solution, tmp_path, kind):
    # The fixture's solution is of the same flat.
    done = run(
        *("position", office / "tags" / kind, "--anchors", pristine_solution / "anchors.csv"),
        *("--reference", office / "survey" / "reference", "--out", tmp_path / "out", "--json"),
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    for method in ("found anchors", "reference anchors"):
        assert told[method]["located"] == told[method]["expected"] > 20
        assert 0.0 < told[method]["median_m"] < 1.0
    with (tmp_path / "out" / "track.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert float(rows[-1]["time_s"]) > float(rows[0]["time_s"])
    assert (tmp_path / "out" / "places.csv").exists() == (kind == "static")
    assert (tmp_path / "out" / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_truth_there_are_places_and_no_errors(run, office, tmp_path):
    recording = tmp_path / "walk"
    shutil.copytree(office / "tags" / "walk", recording)
    (recording / "truth.csv").unlink()
    done = run("position", recording, "--anchors", office / "survey" / "reference" / "anchors.csv")
    assert done.returncode == 0, done.stderr
    assert "located" in done.stdout
    assert "error" not in done.stdout


def test_a_truth_in_another_frame_gives_no_errors(run, office, pristine_solution, tmp_path):
    # Without the reference nothing says how the frame of station s01 lies in the tags'.
    walk = office / "tags" / "walk"
    done = run("position", walk, "--anchors", pristine_solution, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "frame of station s01; --reference DIR" in done.stderr
    assert "located" in done.stdout
    assert "error" not in done.stdout
    # Anchors in the truth's own frame are compared with it, whoever wrote them.
    done = run("position", walk, "--anchors", office / "survey" / "reference" / "anchors.csv")
    assert (done.stderr, "error median" in done.stdout) == ("", True)


def test_faults_end_with_2_and_their_line(run, office, tmp_path):
    recording = tmp_path / "static"
    shutil.copytree(office / "tags" / "static", recording)
    epochs = recording / "epochs.csv"
    epochs.write_text(epochs.read_text().replace("tdoa_s", "tdoa", 1))
    for command in (
        ("check", recording),
        ("position", recording, "--anchors", office / "survey" / "reference"),
    ):
        done = run(*command)
        assert done.returncode == 2
        assert "epochs.csv:2: kind" in done.stdout + done.stderr


def test_a_sound_recording_is_checked(run, office):
    done = run("check", office / "tags" / "walk")
    assert (done.returncode, done.stdout.count("no faults, no warnings")) == (0, 1)


def test_no_anchor_to_be_trusted_ends_with_2(run, office, tmp_path):
    table = tmp_path / "anchors.csv"
    table.write_text("anchor,x_m,y_m,status\nA1,,,unreachable\n")
    done = run("position", office / "tags" / "walk", "--anchors", table)
    assert done.returncode == 2
    assert "A1: unreachable" in done.stderr
