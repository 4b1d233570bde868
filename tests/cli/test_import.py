import gzip

from slam_uwb.io import check_survey

LES = "022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082\n"


def test_import(run, tmp_path):
    (tmp_path / "s01.csv").write_text("X,Y,Z\n300,0,0\n0,400,0\n")
    (tmp_path / "s01.log").write_text(LES * 3)
    (tmp_path / "heights.csv").write_text("anchor,height_m\n022E,2.4\n")
    done = run(
        "import", "sweep-csv", tmp_path / "s01.csv", "--out", tmp_path / "survey", "--tag-height-m", "1.4",
        "--ranges", f"dwm1001-log:{tmp_path / 's01.log'}", "--heights", tmp_path / "heights.csv",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "measure their heights and write them into survey.toml: 9280" in done.stdout
    survey = check_survey(tmp_path / "survey").survey
    assert len(survey.ranges) == 2
    assert survey.anchors[0].height == 2.4


def test_a_wrong_file_is_named_and_nothing_is_written(run, tmp_path):
    (tmp_path / "s01.csv").write_text("X,Y,Z\n300,0,0\n0,4OO,0\n")
    done = run("import", "sweep-csv", tmp_path / "s01.csv", "--out", tmp_path / "survey")
    assert done.returncode == 2
    assert "s01.csv:3: Y:" in done.stderr
    assert not (tmp_path / "survey").exists()


def test_a_bomb_is_refused(run, tmp_path):
    (tmp_path / "s01.csv.gz").write_bytes(gzip.compress(bytes(210_000_000), 9))
    done = run("import", "csv", tmp_path / "s01.csv.gz", "--out", tmp_path / "survey")
    assert done.returncode == 2
    assert "limit of 200,000,000 bytes" in done.stderr


def test_unknown_format(run, tmp_path):
    done = run("import", "dxf", tmp_path / "a.dxf", "--out", tmp_path / "survey")
    assert done.returncode == 2
    assert "there are: sweep-csv" in done.stderr
