import gzip

import pytest

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
    assert "write them into survey.toml (or import with --heights): 9280" in done.stdout
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


FILES = {
    "s01.csv": "anchor,range_m\nA1,3\n",
    "high.csv": "X,Y,Z\n300,0,100\n0,400,120\n",
    "mm.csv": "angle_deg,range_m\n0,3000\n90,2500\n",
    "robot.log": "FLASER 2 50.0 60.0 0 0 0 0 0 0 1.0 host 1.0\n",
    "blind.csv": "angle_deg,range_m\n0,0\n90,\n",
    "cm.csv": "anchor,height_m\nA1,2.4\nA2,240\n",
    "high.ply": "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    "property float z\nend_header\n1 2 3\n",
}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("ranges-csv s01.csv", "the tag's antenna above the floor is needed (--tag-height-m)"),
        ("ranges-csv s01.csv --tag-height-m 140", "--tag-height-m: 140: a height is"),
        (
            "ranges-csv s01.csv --tag-height-m 1.4 --heights cm.csv",
            "--heights cm.csv: anchor A2: 240",
        ),
        ("sweep-csv high.csv", "high.csv: Z: none of 2 points has z from -0.1 to 0.1 m (--band-m)"),
        ("cloud high.ply", "high.ply: none of 1 points has z from -0.1 to 0.1 m (--band-m)"),
        ("csv mm.csv", "mm.csv: none of 2 returns is within 40 m (--max-range-m)"),
        ("carmen robot.log", "robot.log: no return within 40 m (--max-range-m)"),
        ("csv blind.csv", "blind.csv: no return in it"),
        (
            "csv mm.csv --ranges csv:mm.csv",
            "'csv' is no format of ranges (--ranges); there are: dwm",
        ),
        ("csv mm.csv --ranges s01.csv", "--ranges: 's01.csv': expected FORMAT:FILE"),
        ("bag none", "none: no such file or folder"),
    ],
)
def test_what_an_option_could_mend_names_the_option(run, tmp_path, arguments, told):
    if "cloud" in arguments:
        pytest.importorskip("open3d", exc_type=ImportError)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    done = run("import", *arguments.split(), "--out", "survey", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert told in done.stderr
    assert not (tmp_path / "survey").exists()


def test_heights_of_anchors_that_nobody_heard_are_told(run, tmp_path):
    """A typing error there would leave an anchor without its height."""
    (tmp_path / "s01.csv").write_text("anchor,range_m\nA1,3\n")
    (tmp_path / "heights.csv").write_text("anchor,height_m\na1,2.4\n")
    done = run(
        *("import", "ranges-csv", "s01.csv", "--tag-height-m", 1.4, "--heights", "heights.csv"),
        *("--out", "survey"),
        cwd=tmp_path,
    )
    assert done.returncode == 0
    assert "--heights heights.csv: no range is of a1" in done.stderr
    assert done.stdout.splitlines()[-1].endswith(": A1")


def test_unknown_format(run, tmp_path):
    done = run("import", "dxf", tmp_path / "a.dxf", "--out", tmp_path / "survey")
    assert done.returncode == 2
    assert "there are: sweep-csv" in done.stderr


TREK = "mc 03 00000{0}00 00000{0}00 00000000 00000000 0960 c2 00024c60 a{1}:0\n"
TWO_TAGS = TREK.format(1, 0) + TREK.format(2, 10) + TREK.format(3, 0) + TREK.format(4, 0)


@pytest.mark.parametrize(
    ("chosen", "told"),
    [
        ("", "s01.log: tag: several tags: name the one on the tripod (--tag) of 0 (6 readings), 10 (2 readings)"),
        ("--tag 1", "s01.log: tag: there is no tag 1: name the one on the tripod (--tag) of 0 (6"),
    ],
)  # fmt: skip
def test_several_tags_in_a_log_are_not_mixed(run, tmp_path, chosen, told):
    (tmp_path / "s01.log").write_text(TWO_TAGS)
    arguments = ("import", "trek1000-log", tmp_path / "s01.log", "--out", tmp_path / "survey")
    done = run(*arguments, "--tag-height-m", "1.4", *chosen.split())
    assert done.returncode == 2
    assert told in done.stderr.replace("\n", " ")
    assert not (tmp_path / "survey").exists()


@pytest.mark.parametrize(("tag", "expected"), [("0", [0.256, 0.768, 1.024]), ("10", [0.512])])
def test_one_of_several_tags_is_taken(run, tmp_path, tag, expected):
    (tmp_path / "s01.log").write_text(TWO_TAGS)
    done = run(
        "import", "trek1000-log", tmp_path / "s01.log", "--out", tmp_path / "survey", "--tag-height-m", "1.4",
        "--tag", tag,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    links = check_survey(tmp_path / "survey").survey.ranges
    assert {link.anchor: link.distances.tolist() for link in links} == {
        "A0": expected,
        "A1": expected,
    }


def test_a_tag_chosen_where_the_log_names_none(run, tmp_path):
    (tmp_path / "s01.log").write_text(LES)
    done = run(
        "import", "dwm1001-log", tmp_path / "s01.log", "--out", tmp_path / "survey", "--tag-height-m", "1.4",
        "--tag", "3",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
