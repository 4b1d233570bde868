"""``slam-uwb evaluate``."""

import csv
import json

import pytest


def test_scores_a_solution_against_the_truth(run, pristine_survey, pristine_solution):
    done = run("evaluate", pristine_solution, "--reference", pristine_survey / "reference")
    assert (done.returncode, done.stderr) == (0, "")
    assert "RMSE" in done.stdout


def test_json_is_for_programs(run, pristine_survey, pristine_solution):
    done = run(
        "evaluate", pristine_solution, "--reference", pristine_survey / "reference", "--json"
    )
    assert done.returncode == 0
    assert json.loads(done.stdout)["mode"] == "joint"


def test_a_moved_reference_changes_nothing_but_a_wrong_one_does(
    run, pristine_survey, pristine_solution, tmp_path
):
    def score(change):
        reference = tmp_path / change.__name__
        reference.mkdir()
        for name in ("stations.csv", "anchors.csv"):
            with (pristine_survey / "reference" / name).open(newline="") as stream:
                items = list(csv.DictReader(stream))
            with (reference / name).open("w", newline="") as stream:
                writer = csv.DictWriter(stream, items[0].keys())
                writer.writeheader()
                writer.writerows(change(item) for item in items)
        done = run("evaluate", pristine_solution, "--reference", reference)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def same(item):
        return item

    def moved(item):
        return {**item, "x_m": float(item["x_m"]) + 7.0, "y_m": float(item["y_m"]) - 3.0}

    def mirrored(item):
        return {**item, "x_m": -float(item["x_m"])}

    truth = score(same)
    assert score(moved) == truth
    assert score(mirrored) != truth


def test_draws_on_request(run, pristine_survey, pristine_solution, tmp_path):
    figure = tmp_path / "errors.png"
    done = run(
        *("evaluate", pristine_solution, "--reference", pristine_survey / "reference"),
        *("--figure", figure),
    )
    assert done.returncode == 0, done.stderr
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_writes_trajectories_for_other_tools(run, pristine_survey, pristine_solution, tmp_path):
    done = run(
        *("evaluate", pristine_solution, "--reference", pristine_survey / "reference"),
        *("--tum", tmp_path / "tum", "--align", "both"),
    )
    assert done.returncode == 0, done.stderr
    assert "stations and anchors" in done.stdout
    rows = {
        name: [line.split() for line in (tmp_path / "tum" / name).read_text().splitlines()]
        for name in ("estimate.tum", "reference.tum")
    }
    assert all(len(row) == 8 for lines in rows.values() for row in lines)
    # The same stations by the same numbers, so that another tool pairs them.
    assert {row[0] for row in rows["estimate.tum"]} <= {row[0] for row in rows["reference.tum"]}


@pytest.mark.parametrize(
    ("out", "reference"), [("nowhere", "flat/reference"), ("flat", "flat/reference")]
)
def test_what_is_no_solution_ends_with_2(run, survey, out, reference):
    base = survey.parent
    done = run("evaluate", base / out, "--reference", base / reference)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "command", [["evaluate", "--reference", "r"], ["plan"], ["report"], ["export", "--to", "dxf"]]
)
def test_a_folder_that_holds_no_solution_is_named_with_what_makes_one(run, tmp_path, command):
    name, *options = command
    (tmp_path / "empty").mkdir()
    done = run(name, "empty", *options, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "slam-uwb: empty: no solution.json in it: a solution is written by "
        "`slam-uwb solve SURVEY --out empty`\n"
    )


def test_a_survey_given_for_its_solution_is_said_to_be_one(run, survey):
    done = run("evaluate", survey, "--reference", survey / "reference")
    assert done.returncode == 2
    assert f"{survey}: is a survey that is not solved here" in done.stderr
    assert f"slam-uwb solve {survey} --out OUT" in done.stderr


@pytest.mark.parametrize("reference", ["nowhere", "flat/scans"])
def test_what_is_no_reference_ends_with_2(run, survey, pristine_solution, reference):
    done = run("evaluate", pristine_solution, "--reference", survey.parent / reference)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("slam-uwb: ")


def test_a_damaged_solution_ends_with_2_and_names_the_file(run, pristine_survey, solution):
    document = solution / "solution.json"
    document.write_bytes(document.read_bytes()[:1000])
    done = run("evaluate", solution, "--reference", pristine_survey / "reference")
    assert done.returncode == 2
    assert done.stderr.startswith(f"slam-uwb: {solution}: solution.json")
