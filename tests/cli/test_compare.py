"""``slam-uwb compare``."""

import csv


def test_surveys_side_by_side(run, pristine_survey, tmp_path):
    out = tmp_path / "comparison"
    chosen = ("--initialiser", "correlative", "--refiner", "point_to_line")
    done = run("compare", pristine_survey, "--out", out, *chosen)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "comparison.csv",
        "comparison.md",
        "comparison.png",
        "comparison.tex",
    ]
    with (out / "comparison.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["mode"] for row in rows] == ["joint", "sequential"]
    assert all(float(row["seconds"]) > 0.0 for row in rows)
    assert (out / "comparison.md").read_text() in done.stdout


def test_a_broken_survey_ends_with_2_before_any_work(run, pristine_survey, survey, tmp_path):
    (survey / "survey.toml").write_text("format = 2\n")
    done = run("compare", pristine_survey, survey, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "format" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_no_comparison_is_refused(run, pristine_survey, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    done = run("compare", pristine_survey, "--out", tmp_path / "mine")
    assert done.returncode == 2
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "years of work"
