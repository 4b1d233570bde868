"""``slam-uwb simulate``."""

import tomllib

import pytest

from slam_uwb.simulate import SCENES


def test_list_names_every_scene(run):
    done = run("simulate", "--list")
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == [*SCENES, "random-floor-N"]


def test_same_seed_same_bytes(run, pristine_survey, contents, tmp_path):
    again, other = tmp_path / "again", tmp_path / "other"
    assert run("simulate", "flat", "--seed", 1, "--duration-s", 4, "--out", again).returncode == 0
    assert run("simulate", "flat", "--seed", 2, "--duration-s", 4, "--out", other).returncode == 0
    assert contents(again) == contents(pristine_survey)
    assert contents(other) != contents(pristine_survey)


def test_writes_the_truth_beside_what_was_measured(pristine_survey, contents):
    files = contents(pristine_survey)
    assert {"survey.toml", "ranges.csv.gz", "reference/anchors.csv", "reference/stations.csv"} <= {
        *files
    }


def test_options_shape_the_survey(run, tmp_path, contents):
    out = tmp_path / "out"
    done = run(
        *("simulate", "flat", "--seed", 3, "--out", out, "--two-way", "--no-sequence"),
        *("--duration-s", 2),
    )
    assert done.returncode == 0, done.stderr
    files = contents(out)
    assert "twr.csv.gz" in files
    assert "ranges.csv.gz" not in files
    assert "sequence" not in tomllib.loads(files["survey.toml"].decode())


def test_duration_decides_how_much_is_recorded(run, pristine_survey, tmp_path):
    out = tmp_path / "out"
    assert run("simulate", "flat", "--seed", 1, "--duration-s", 8, "--out", out).returncode == 0
    short, long = (
        sum(path.stat().st_size for path in (folder / "scans").rglob("*.gz"))
        for folder in (pristine_survey, out)
    )
    # Twice the samples; the compression varies a little.
    assert 1.6 < long / short < 2.4


def test_unknown_scene_ends_with_2_and_names_the_known(run, tmp_path):
    done = run("simulate", "castle", "--seed", 1, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "castle" in done.stderr
    assert "paper-office" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["notes.txt", "survey.toml"])
def test_never_overwrites_anything(run, tmp_path, contents, name):
    out = tmp_path / "mine"
    out.mkdir()
    (out / name).write_text("recorded on site")
    done = run("simulate", "flat", "--seed", 1, "--out", out)
    assert done.returncode == 2
    assert str(out) in done.stderr
    assert contents(tmp_path) == {f"mine/{name}": b"recorded on site"}


def test_a_file_is_no_folder_to_write(run, tmp_path):
    out = tmp_path / "file"
    out.write_text("text")
    done = run("simulate", "flat", "--seed", 1, "--out", out)
    assert (done.returncode, out.read_text()) == (2, "text")
