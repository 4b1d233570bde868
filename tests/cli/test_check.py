"""``slam-uwb check``, and that ``solve`` refuses the same folders before it writes anything."""

import gzip
import json

import pytest


def _replace(path, old, new):
    packed = path.suffix == ".gz"
    text = (gzip.decompress(path.read_bytes()) if packed else path.read_bytes()).decode()
    assert old in text
    data = text.replace(old, new, 1).encode()
    path.write_bytes(gzip.compress(data) if packed else data)


def _append(path, row):
    text = gzip.decompress(path.read_bytes()).decode()
    path.write_bytes(gzip.compress((text + row + "\n").encode()))
    return text.count("\n") + 1


def missing_folder(survey):
    for path in sorted(survey.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    survey.rmdir()
    return ["flat", "no such folder"]


def no_survey_toml(survey):
    (survey / "survey.toml").unlink()
    return ["survey.toml"]


def broken_toml(survey):
    _replace(survey / "survey.toml", "[lidar]", "[lidar")
    return ["survey.toml:5"]


def missing_key(survey):
    _replace(survey / "survey.toml", 'angle_direction = "ccw"\n', "")
    return ["survey.toml", "angle_direction"]


def value_outside_its_limits(survey):
    _replace(survey / "survey.toml", 'angle_direction = "ccw"', 'angle_direction = "left"')
    return ["survey.toml:7", "angle_direction", "left"]


def missing_scan(survey):
    (survey / "scans" / "s02.csv.gz").unlink()
    return ["scans/s02.csv.gz"]


def path_that_leaves_the_folder(survey):
    _replace(survey / "survey.toml", '"scans/s02.csv.gz"', '"../../s02.csv"')
    return ["../../s02.csv"]


def text_for_a_number(survey):
    line = _append(survey / "ranges.csv.gz", "s01,A1,far")
    return [f"ranges.csv.gz:{line}", "range_m", "far"]


def unknown_station_in_the_sequence(survey):
    _replace(survey / "survey.toml", '["s01", "s02"]', '["s01", "ghost"]')
    return ["survey.toml:3", "sequence", "ghost"]


def unknown_station_in_a_table(survey):
    line = _append(survey / "ranges.csv.gz", "ghost,A1,3.2")
    return [f"ranges.csv.gz:{line}", "station", "ghost"]


def bad_header(survey):
    _replace(survey / "ranges.csv.gz", "station,anchor,range_m", "station,anchor,metres")
    return ["ranges.csv.gz:1", "range_m"]


def duplicate_anchor(survey):
    with (survey / "survey.toml").open("a") as file:
        file.write('\n[[anchors]]\nid = "A1"\nheight_m = 2.0\n')
    return ["survey.toml:", "A1", "twice"]


def newer_format(survey):
    _replace(survey / "survey.toml", "format = 1", "format = 2")
    return ["survey.toml:1", "format", "2"]


def scan_without_any_return(survey):
    rows = "".join(f"{angle},0\n" for angle in range(360))
    (survey / "scans" / "s02.csv.gz").write_bytes(
        gzip.compress(f"angle_deg,range_m\n{rows}".encode())
    )
    return ["scans/s02.csv.gz", "return"]


FAULTS = [
    unknown_station_in_a_table,
    bad_header,
    duplicate_anchor,
    newer_format,
    scan_without_any_return,
    missing_folder,
    no_survey_toml,
    broken_toml,
    missing_key,
    value_outside_its_limits,
    missing_scan,
    path_that_leaves_the_folder,
    text_for_a_number,
    unknown_station_in_the_sequence,
]


def test_a_sound_survey(run, pristine_survey):
    done = run("check", pristine_survey)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{pristine_survey}: no faults, no warnings\n"


@pytest.mark.parametrize("spoil", FAULTS)
def test_check_names_the_fault_and_ends_with_2(run, survey, spoil):
    named = spoil(survey)
    done = run("check", survey)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    faults = [line for line in done.stdout.splitlines() if line.startswith("fault: ")]
    assert len(faults) == 1
    assert [text for text in named if text not in faults[0]] == []
    assert done.stdout.splitlines()[-1].endswith(": 1 fault, no warnings")


@pytest.mark.parametrize("spoil", FAULTS)
def test_solve_says_the_same_on_stderr_and_writes_nothing(run, survey, tmp_path, spoil):
    named = spoil(survey)
    before = sorted(tmp_path.rglob("*"))
    done = run("solve", survey, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert [text for text in named if text not in done.stderr] == []
    assert sorted(tmp_path.rglob("*")) == before


def test_every_fault_is_told_at_once(run, survey):
    missing_scan(survey)
    text_for_a_number(survey)
    unknown_station_in_the_sequence(survey)
    done = run("check", survey)
    assert done.returncode == 2
    assert done.stdout.splitlines()[-1] == f"{survey}: 3 faults, no warnings"
    assert len(run("solve", survey, "--out", survey.parent / "out").stderr.splitlines()) == 3


def test_a_warning_is_no_fault(run, survey):
    _replace(survey / "survey.toml", "[lidar]\n", "[lidar]\ncolour = 'red'\n")
    done = run("check", survey)
    assert done.returncode == 0
    assert "warning: survey.toml:6" in done.stdout
    assert "colour" in done.stdout
    assert done.stdout.endswith(": no faults, 1 warning\n")


def test_json_for_programs(run, survey):
    line = _append(survey / "ranges.csv.gz", "s01,A1,far")
    _replace(survey / "survey.toml", "[lidar]\n", "[lidar]\ncolour = 'red'\n")
    done = run("check", survey, "--json")
    assert done.returncode == 2
    report = json.loads(done.stdout)
    assert (report["survey"], report["ok"]) == (str(survey), False)
    (fault,) = report["faults"]
    place = {key: fault[key] for key in ("path", "line", "column")}
    assert place == {"path": "ranges.csv.gz", "line": line, "column": "range_m"}
    assert [warning["path"] for warning in report["warnings"]] == ["survey.toml"]


def test_json_of_a_sound_survey(run, pristine_survey):
    report = json.loads(run("check", pristine_survey, "--json").stdout)
    assert report == {"survey": str(pristine_survey), "ok": True, "faults": [], "warnings": []}


def test_a_folder_that_is_no_survey_is_named(run, tmp_path):
    (tmp_path / "photos").mkdir()
    done = run("solve", "photos", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == ("slam-uwb: photos: no survey.toml in it: expected a survey folder\n")
