import gzip
import shutil

import numpy as np
import pytest

from slam_uwb.io import check_survey, read_survey
from slam_uwb.io.files import FolderReader
from slam_uwb.io.findings import Findings
from slam_uwb.model.errors import SurveyFormatError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import Decision, KnownPlace, RangeOffset

TOML = "survey.toml"


def test_everything_of_a_small_survey(make_survey):
    survey = read_survey(make_survey())
    assert survey.name == "two rooms"
    assert survey.sequence == (("s01", "s02"),)
    assert [station.id for station in survey.stations] == ["s01", "s02"]
    scan = survey.stations[0].scan
    # 270 degrees are -90; (-pi, pi].
    np.testing.assert_array_equal(scan.bearings, np.deg2rad([0.0, 90.0, 180.0, -90.0]))
    np.testing.assert_array_equal(scan.ranges, [1.0, 2.0, 3.0, 4.0])
    assert scan.max_range == 25.0
    assert survey.stations[0].tag_height == 1.4
    assert (survey.anchors[0].id, survey.anchors[0].height) == ("A1", 2.4)
    assert [(r.station, r.anchor, r.distances.tolist()) for r in survey.ranges] == [
        ("s01", "A1", [3.25, 3.5]),
        ("s02", "A1", [4.5]),
    ]
    assert survey.range_offset is None


def test_clockwise_scanner_is_turned_round(make_survey):
    survey = read_survey(make_survey({TOML: ('"ccw"', '"cw"')}))
    expected = np.deg2rad([0.0, -90.0, 180.0, 90.0])
    np.testing.assert_array_equal(survey.stations[0].scan.bearings, expected)


@pytest.mark.parametrize("nothing", ["", "nan", "NaN", "0", "0.0", "25.01", "inf", " "])
def test_no_return(make_survey, nothing):
    scan = f"range_m,angle_deg\n1,10\n{nothing},20\n"
    survey = read_survey(make_survey({"scans/s01.csv": scan}))
    np.testing.assert_array_equal(survey.stations[0].scan.ranges, [1.0, np.nan])


@pytest.mark.parametrize(
    "text",
    [
        "angle_deg,range_m\r\n10,1\r\n20,2\r\n",
        "\ufeffangle_deg,range_m\n10,1\n20,2",
        "angle_deg, range_m\n\n10, 1\n  \n20,2\n\n",
        '"angle_deg","range_m"\n"10","1"\n20,2\n',
        "range_m,signal,time_s,angle_deg\n1,,0.0,10\n2,7,,20\n",
    ],
    ids=["CRLF", "byte order mark", "blank lines and spaces", "quotes", "column order"],
)
def test_dialects_of_csv(make_survey, text):
    check = check_survey(make_survey({"scans/s01.csv": text}))
    assert check.warnings == ()
    scan = check.survey.stations[0].scan
    np.testing.assert_array_equal(scan.bearings, np.deg2rad([10.0, 20.0]))
    np.testing.assert_array_equal(scan.ranges, [1.0, 2.0])


def test_dialects_of_toml(make_survey):
    text = (make_survey(folder="text") / TOML).read_text()
    data = b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()
    assert check_survey(make_survey({TOML: data})).faults == ()


def test_compressed_files_by_either_name(make_survey):
    plain = read_survey(make_survey())
    folder = make_survey(folder="packed")
    for name in ("scans/s01.csv", "scans/s02.csv", "ranges.csv"):
        path = folder / name
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(path.read_bytes()))
        path.unlink()
    text = (folder / TOML).read_text()
    (folder / TOML).write_text(text.replace("scans/s02.csv", "scans/s02.csv.gz"))
    packed = read_survey(folder)
    for a, b in zip(plain.stations, packed.stations, strict=True):
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
    assert [r.distances.tolist() for r in packed.ranges] == [[3.25, 3.5], [4.5]]


def test_several_files_are_one_scan(make_survey):
    toml = ('scan = "scans/s01.csv"', 'scan = ["scans/s01.csv", "scans/more.csv"]')
    more = {"scans/more.csv": "angle_deg,range_m\n45,7\n"}
    survey = read_survey(make_survey({TOML: toml} | more))
    assert survey.stations[0].scan.ranges.tolist() == [1.0, 2.0, 3.0, 4.0, 7.0]


def test_upper_scan_and_heights(make_survey):
    scan = 'scan = "scans/s01.csv"\n'
    upper = 'upper_scan = "scans/up.csv"\nupper_scan_height_m = 2.5\ntag_height_m = 1.38\n'
    toml = (scan, scan + upper)
    up = {"scans/up.csv": "angle_deg,range_m\n45,7\n"}
    first, second = read_survey(make_survey({TOML: toml} | up)).stations
    assert first.upper_scan.ranges.tolist() == [7.0]
    assert (first.upper_scan_height, first.tag_height) == (2.5, 1.38)
    assert (second.upper_scan, second.tag_height) == (None, 1.4)


def test_places_offset_and_radio(make_survey):
    toml = (
        """
[tag]
height_m = 1.4
""",
        """
[tag]
height_m = 1.4
offset_x_m = 0.1
offset_y_m = -0.2
range_offset_m = 0.15
""",
    )
    text = (make_survey({TOML: toml}, "text") / TOML).read_text()
    text = text.replace(
        'id = "s01"', 'id = "s01"\nx_m = 1\ny_m = 2.5\nyaw_deg = -180\nsigma_yaw_deg = 2'
    )
    text = text.replace('id = "A1"', 'id = "A1"\nradio = "0x022E"\nx_m = 4\ny_m = 5\nsigma_m = 0.1')
    ranges = "station,anchor,range_m\ns01,0x022E,3\ns01,A1,4\n"
    survey = read_survey(make_survey({TOML: text, "ranges.csv": ranges}))
    assert survey.stations[0].known == KnownPlace(1.0, 2.5, 0.02, np.pi, np.deg2rad(2.0))
    assert survey.stations[1].known is None
    assert survey.anchors[0].known == KnownPlace(4.0, 5.0, 0.1)
    assert survey.tag_offset == (0.1, -0.2)
    assert survey.range_offset == RangeOffset(0.15, 0.05)
    # By identifier or radio: one link.
    assert [r.distances.tolist() for r in survey.ranges] == [[3.0, 4.0]]


def test_periods_replace_the_ranges_of_their_link(make_survey):
    twr = "station,anchor,t1_s,t2_s,t3_s,t4_s\ns01,A1,1.5e-3,1.4e-3,1.3e-3,1.2e-3\n"
    survey = read_survey(make_survey({"twr.csv": twr}))
    assert [(r.station, r.anchor) for r in survey.ranges] == [("s02", "A1")]
    assert [(p.station, p.anchor) for p in survey.periods] == [("s01", "A1")]
    np.testing.assert_array_equal(survey.periods[0].periods, [[1.5e-3, 1.4e-3, 1.3e-3, 1.2e-3]])


def test_anchor_ranges_of_either_direction_are_one_pair(make_survey):
    text = (make_survey(folder="text") / TOML).read_text() + '[[anchors]]\nid = "A2"\n'
    between = "anchor_a,anchor_b,range_m\nA1,A2,7\nA2,A1,7.5\n"
    survey = read_survey(make_survey({TOML: text, "anchor_ranges.csv": between}))
    (pair,) = survey.anchor_ranges
    assert (pair.anchor_a, pair.anchor_b, pair.distances.tolist()) == ("A1", "A2", [7.0, 7.5])


def test_decisions(make_survey):
    decisions = (
        "kind,a,b,decision,dx_m,dy_m,dyaw_deg\npair,s01,s02,guess,1.5,-2,90\nlink,s02,A1,drop,,,\n"
    )
    survey = read_survey(make_survey({"decisions.csv": decisions}))
    assert survey.decisions == (
        Decision("pair", "s01", "s02", "guess", Pose2(1.5, -2.0, np.pi / 2)),
        Decision("link", "s02", "A1", "drop"),
    )


def test_without_ranges(make_survey):
    text = 'format = 1\nname = "x"\n[lidar]\nangle_direction = "cw"\n[[stations]]\nid = "s01"\n'
    text += 'scan = "scans/s01.csv"\n'
    survey = read_survey(make_survey({TOML: text, "ranges.csv": None}))
    assert survey.ranges == ()
    assert survey.sequence is None
    assert np.isnan(survey.stations[0].tag_height)
    assert survey.stations[0].scan.max_range == 40.0


def test_without_scans(make_survey):
    text = 'format = 1\nname = "x"\n[tag]\nheight_m = 1\n[[stations]]\nid = "s01"\nx_m = 1\n'
    text += 'y_m = 2\n[[stations]]\nid = "s02"\n[[anchors]]\nid = "A1"\n'
    survey = read_survey(make_survey({TOML: text}))
    assert [station.scan for station in survey.stations] == [None, None]
    assert survey.stations[0].known == KnownPlace(1.0, 2.0)
    assert survey.anchors[0].height is None
    assert len(survey.ranges) == 2


def test_checksum_is_of_the_files_wherever_they_lie(make_survey):
    folder = make_survey()
    checksum = read_survey(folder).checksum
    assert len(checksum) == 64
    moved = shutil.move(folder, folder.with_name("elsewhere"))
    assert read_survey(moved).checksum == checksum
    (moved / "reference").mkdir()
    (moved / "reference" / "anchors.csv").write_text("anchor,x_m,y_m\n")
    (moved / "notes.txt").write_text("not of the survey")
    assert read_survey(moved).checksum == checksum
    for name in ("survey.toml", "scans/s02.csv", "ranges.csv"):
        path = moved / name
        before = path.read_bytes()
        path.write_bytes(before + b"\n")
        assert read_survey(moved).checksum != checksum
        path.write_bytes(before)
    (moved / "scans" / "s01.csv").rename(moved / "scans" / "s1.csv")
    text = (moved / TOML).read_text()
    (moved / TOML).write_text(text.replace("scans/s01.csv", "scans/s1.csv"))
    assert read_survey(moved).checksum != checksum


def test_checksum_is_of_names_too(tmp_path):
    """The same contents under another name are another survey; the order of reading is not."""
    for name in ("a.csv", "b.csv", "c.csv"):
        (tmp_path / name).write_text("same" if name != "b.csv" else "other")

    def checksum(*names):
        reader = FolderReader(tmp_path.resolve(), Findings())
        for name in names:
            reader.read(name)
        return reader.checksum()

    assert checksum("a.csv", "b.csv") == checksum("b.csv", "a.csv")
    assert checksum("a.csv") != checksum("c.csv")


def test_every_fault_at_once(make_survey):
    folder = make_survey(
        {
            TOML: ('id = "s02"', 'id = "s02"\ntag_height_m = "high"'),
            "scans/s01.csv": "angle_deg,range_m\n0,one\n",
            "scans/s02.csv": None,
            "ranges.csv": "station,anchor,range_m\ns09,A1,3\ns01,A1,x\n",
        }
    )
    with pytest.raises(SurveyFormatError) as raised:
        read_survey(folder)
    assert {fault.path for fault in raised.value.faults} == {
        TOML,
        "scans/s01.csv",
        "scans/s02.csv",
        "ranges.csv",
    }
    assert len(raised.value.faults) == 5
    assert raised.value.exit_status == 2
    assert len(str(raised.value).splitlines()) == 5
