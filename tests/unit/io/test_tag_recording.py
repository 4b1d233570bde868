"""Positioning recordings: read back as written, every fault named."""

import numpy as np
import pytest

from slam_uwb.io.anchor_places import read_anchor_places
from slam_uwb.io.tag_recording import (
    check_tag_recording,
    read_tag_recording,
    tag_recording_files,
)
from slam_uwb.model.errors import SurveyFormatError
from slam_uwb.model.tag import (
    Epoch,
    PowerLaw,
    ReceivedPower,
    Stay,
    TagRecording,
    TagTruth,
    TimeDifference,
)

TOML = """format = 1
name = "r"
[tag]
height_m = 1.2
[power]
at_one_metre_dbm = -59.0
exponent = 2.5
sigma_db = 6.0
[[places]]
id = "p1"
start_s = 0.0
end_s = 5.0
"""
EPOCHS = """time_s,kind,anchor_a,anchor_b,value
1.0,tdoa_s,A,B,1e-9
0.0,tdoa_s,A,B,2e-9
0.0,rss_dbm,A,,-60
"""
TRUTH = "place,x_m,y_m\np1,1.0,2.0\n"


@pytest.fixture
def folder(tmp_path):
    for name, text in (("positioning.toml", TOML), ("epochs.csv", EPOCHS), ("truth.csv", TRUTH)):
        (tmp_path / name).write_text(text)
    return tmp_path


def change(folder, file, old, new):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


def test_rows_become_epochs_in_the_order_of_time(folder):
    recording, truth = read_tag_recording(folder)
    assert [epoch.time for epoch in recording.epochs] == [0.0, 1.0]
    # Light goes 0.299792458 m in a nanosecond.
    assert recording.epochs[0].differences[0].difference == pytest.approx(2 * 0.299792458)
    assert recording.epochs[0].powers == (ReceivedPower("A", -60.0),)
    assert recording.power_law == PowerLaw(-59.0, 2.5, 6.0)
    assert recording.stays == (Stay("p1", 0.0, 5.0),)
    np.testing.assert_array_equal(truth.places["p1"], [1.0, 2.0])


@pytest.mark.parametrize("static", [True, False])
def test_what_is_written_is_read_back(tmp_path, static):
    recording = TagRecording(
        "walk",
        1.25,
        (
            Epoch(0.0, (TimeDifference("A", "B", 1.2345),), (ReceivedPower("A", -61.0),)),
            Epoch(0.5, (TimeDifference("C", "B", float("nan")),), ()),
        ),
        (Stay("p1", 0.0, 9.0),) if static else (),
        PowerLaw(-59.0, 3.0, 8.0),
        {"A": 2.4},
    )
    path = np.array([[0.0, 0.0], [1.0, 2.0]])
    truth = TagTruth({"p1": np.array([1.0, 2.0])}) if static else TagTruth({}, path)
    for name, content in tag_recording_files(recording, truth).items():
        (tmp_path / name).write_bytes(content)
    back, told = read_tag_recording(tmp_path)
    first, second = back.epochs
    assert first.differences[0].difference == pytest.approx(1.2345, abs=1e-6)
    assert first.powers == recording.epochs[0].powers
    assert np.isnan(second.differences[0].difference)
    for name in ("name", "tag_height", "stays", "power_law", "anchor_heights"):
        assert getattr(back, name) == getattr(recording, name)
    if static:
        np.testing.assert_array_equal(told.places["p1"], truth.places["p1"])
    else:
        np.testing.assert_array_equal(told.path, path)


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("epochs.csv", "rss_dbm", "rssi", "epochs.csv:4: kind"),
        ("epochs.csv", "1.0,tdoa_s,A,B", "1.0,tdoa_s,A,", "epochs.csv:2: anchor_b"),
        ("epochs.csv", "1.0,tdoa_s,A,B", "1.0,tdoa_s,A,A", "epochs.csv:2: anchor_b"),
        ("epochs.csv", "A,,-60", "A,B,-60", "epochs.csv:4: anchor_b"),
        ("epochs.csv", "2e-9", "two", "epochs.csv:3: value"),
        ("epochs.csv", "1.0,tdoa", "later,tdoa", "epochs.csv:2: time_s"),
        ("positioning.toml", "format = 1", "format = 2", "positioning.toml:1"),
        ("positioning.toml", "height_m = 1.2", "height_m = 120", "positioning.toml:4"),
        ("positioning.toml", "height_m = 1.2", "", "tag.height_m: field required"),
        ("positioning.toml", "end_s = 5.0", "end_s = -1.0", "expected more than start_s"),
        ("positioning.toml", "[tag]", "[tag", "no TOML"),
        ("truth.csv", "p1", "p9", "truth.csv:2: place"),
        ("truth.csv", "place,", "", "truth.csv"),
        ("truth.csv", "1.0", "nan", "truth.csv:2: x_m"),
    ],
)
def test_every_fault_says_where(folder, file, old, new, told):
    change(folder, file, old, new)
    check = check_tag_recording(folder)
    assert check.recording is None
    assert any(told in str(fault) for fault in check.faults), check.faults


def test_powers_need_their_law(folder):
    start, end = TOML.index("[power]"), TOML.index("[[places]]")
    (folder / "positioning.toml").write_text(TOML[:start] + TOML[end:])
    with pytest.raises(SurveyFormatError, match=r"\[power\]"):
        read_tag_recording(folder)


def test_doubts_are_warnings(folder):
    change(folder, "positioning.toml", "height_m = 1.2", "height_m = 1.2\nheigth_m = 3.0")
    change(
        folder,
        "positioning.toml",
        "end_s = 5.0",
        "end_s = 5.0\n[[places]]\nid='p2'\nstart_s=7.0\nend_s=9.0",
    )
    change(folder, "epochs.csv", "1e-9", "1e-3")
    check = check_tag_recording(folder)
    told = "\n".join(map(str, check.warnings))
    assert "heigth_m: unknown key" in told
    assert "place p2: no epoch" in told
    assert "more than 1000 m" in told
    assert np.isnan(check.recording.epochs[1].differences[0].difference)


def test_a_missing_folder_or_file_is_named(tmp_path):
    assert "no such folder" in str(check_tag_recording(tmp_path / "none").faults[0])
    assert "positioning.toml" in str(check_tag_recording(tmp_path).faults[0])


def test_anchors_that_are_not_ok_or_have_no_height_are_left_out(tmp_path):
    (tmp_path / "anchors.csv").write_text(
        "anchor,x_m,y_m,z_m,status\nA,1,2,2.5,ok\nB,3,4,,ok\nC,5,6,2.5,weak-geometry\nD,7,8,,ok\n"
    )
    found, left_out = read_anchor_places(tmp_path, {"B": 2.1})
    assert {name: place.tolist() for name, place in found.items()} == {
        "A": [1.0, 2.0, 2.5],
        "B": [3.0, 4.0, 2.1],
    }
    assert left_out == ("C: weak-geometry", "D: no height")


def test_anchors_of_ones_own_need_no_status_and_faults_are_named(tmp_path):
    table = tmp_path / "mine.csv"
    table.write_text("anchor,x_m,y_m\nA,1,2\n")
    found, _ = read_anchor_places(table, {"A": 2.0})
    assert found["A"].tolist() == [1.0, 2.0, 2.0]
    table.write_text("anchor,x_m,y_m\nA,1,2\nA,1,2\n")
    with pytest.raises(SurveyFormatError, match="twice"):
        read_anchor_places(table, {})
    with pytest.raises(SurveyFormatError, match="no such file"):
        read_anchor_places(tmp_path / "none.csv", {})
