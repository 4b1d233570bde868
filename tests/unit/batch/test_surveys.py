"""Which surveys are found, and where their solutions go."""

from pathlib import Path

import pytest

from slam_uwb.batch.solving import failed_row
from slam_uwb.batch.summary import SurveyRow, format_rows, summary_csv
from slam_uwb.batch.surveys import SurveyTask, find_surveys
from slam_uwb.model.errors import DisconnectedSurveyError, Fault, SurveyFormatError
from slam_uwb.model.settings import Settings


def make(folder, *names):
    for name in names:
        (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / name / "survey.toml").write_text("format = 1\n")


def names(folders, out):
    return [task.name for task in find_surveys(folders, out, Settings())]


def test_surveys_are_found_at_any_depth_by_name(tmp_path):
    make(tmp_path, "b/x", "a", "a/inner", ".hidden/y", "out/old")
    (tmp_path / "empty").mkdir()
    # Not below a survey, not in hidden folders, not in the batch's own.
    assert names([tmp_path], tmp_path / "out") == ["a", "b/x"]


def test_a_survey_by_itself_has_its_own_name(tmp_path, monkeypatch):
    make(tmp_path, "a/x")
    assert names([tmp_path / "a/x"], tmp_path / "out") == ["x"]
    monkeypatch.chdir(tmp_path / "a/x")
    assert names([Path()], tmp_path / "out") == ["x"]


def test_the_same_survey_twice_is_once(tmp_path):
    make(tmp_path, "a/x")
    assert names([tmp_path / "a", tmp_path / "a/x"], tmp_path / "out") == ["x"]


def test_links_to_surveys_are_followed_but_not_in_circles(tmp_path):
    make(tmp_path, "real/x")
    folder = tmp_path / "links"
    folder.mkdir()
    (folder / "x").symlink_to(tmp_path / "real/x")
    (folder / "circle").symlink_to(folder)
    assert names([folder], tmp_path / "out") == ["x"]


@pytest.mark.parametrize("other", ["b/x", "b/x/y"])
def test_two_surveys_never_share_a_folder(tmp_path, other):
    make(tmp_path, "a/x", other)
    with pytest.raises(Exception, match="both be solved into"):
        names([tmp_path / "a", tmp_path / "b"], tmp_path / "out")


@pytest.mark.parametrize("folder", ["empty", "missing"])
def test_a_folder_without_surveys_is_named(tmp_path, folder):
    (tmp_path / "empty").mkdir()
    with pytest.raises(Exception, match=f"{folder}: no survey"):
        names([tmp_path / folder], tmp_path / "out")


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (DisconnectedSurveyError("two\nlines"), 3, "the survey cannot be solved: two lines"),
        (SurveyFormatError([Fault("a.csv", "bad", 3)]), 2, "a.csv:3: bad"),
        (SurveyFormatError([Fault("a.csv", "bad")] * 3), 2, "a.csv: bad (and 2 more: slam-uwb check)"),
        (FileNotFoundError(2, "No such file", "x.csv"), 2, "x.csv: No such file"),
        (ZeroDivisionError("x"), 1, "internal error, please report it: ZeroDivisionError: x"),
    ],
)  # fmt: skip
def test_why_a_survey_failed_is_one_line(tmp_path, error, status, reason):
    row = failed_row(SurveyTask("a", tmp_path, tmp_path / "out", Settings()), error)
    assert (row.exit_status, row.reason) == (status, reason)


def test_reasons_are_bounded(tmp_path):
    task = SurveyTask("a", tmp_path, tmp_path / "out", Settings())
    assert len(failed_row(task, ValueError("x" * 10_000)).reason) <= 500


def test_the_summary_has_a_line_each_and_nothing_for_the_unknown():
    rows = [SurveyRow("a", 0, 4, 5, 6, 7, "s01", 0, "abc", "1.0"), SurveyRow("b, c", None)]
    lines = summary_csv(rows).decode().splitlines()
    assert lines[1] == "a,0,4,5,6,7,s01,0,abc,1.0,"
    assert lines[2] == '"b, c",,,,,,,,,,'
    assert format_rows(rows)[-1] == "1 of 2 solved"
