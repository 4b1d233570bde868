"""Each format on a small file made for the test; faults name file, line and field."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from slam_uwb.cli.import_survey import line_parsers
from slam_uwb.io.importers import ImportOptions, import_survey
from slam_uwb.io.importers.source import station_name
from slam_uwb.model.errors import MissingLibraryError, SlamUwbError, SurveyFormatError

OPTIONS = ImportOptions("test", tag_height=1.4, parsers=line_parsers())


def degrees(scan):
    return np.rad2deg(scan.bearings).round(6).tolist()


def imported(form, path, **changes):
    survey, reference = import_survey(form, [path], [], OPTIONS)
    return survey, reference


@pytest.fixture
def file(tmp_path):
    def write(name, text):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_sweep_csv(file):
    # 3 m ahead, 4 m to the left, a missing return (1 cm), and one a metre higher.
    text = "X,Y,Z,SIGNAL_STRENGTH\n300,0,0,150\n0,400,0.0,112\n1,0,0,30\n100,0,100,199\n"
    survey, _ = imported("sweep-csv", file("s07.csv", text))
    (station,) = survey.stations
    assert station.id == "s07"
    assert degrees(station.scan) == [0.0, 90.0, 0.0]
    assert np.array_equal(station.scan.ranges, [3.0, 4.0, np.nan], equal_nan=True)


def test_frame_grabber(file):
    text = (
        "#RPLIDAR SCAN DATA\n#COUNT=3\n#Angule\tDistance\tQuality\n"
        "1.2030 1526.5 60\n90.0000 2000.0 60\n180.5 0.0 0\n"
    )
    survey, _ = imported("frame-grabber", file("s01.txt", text))
    scan = survey.stations[0].scan
    # The device counts clockwise.
    assert degrees(scan) == [-1.203, -90.0, 179.5]
    assert np.array_equal(scan.ranges, [1.5265, 2.0, np.nan], equal_nan=True)


@pytest.mark.parametrize(
    ("header", "row"),
    [("angle_deg,range_m", "90,2.5"), ("distance_mm,x,angle_rad", "2500,0,1.5707963267948966")],
)
def test_plain_csv(file, header, row):
    survey, _ = imported("csv", file("s01.csv.gz", gzip.compress(f"{header}\n{row}\n".encode())))
    assert degrees(survey.stations[0].scan) == [90.0]
    assert survey.stations[0].scan.ranges.tolist() == [2.5]


def flaser(x, y, theta, ranges):
    values = " ".join(f"{r:.3f}" for r in ranges)
    return f"FLASER {len(ranges)} {values} {x} {y} {theta} {x} {y} {theta} 1.0 host 1.0\n"


def test_carmen_flaser_merges_a_turn_into_a_full_circle(file):
    # In the middle of a square of 4 m, facing along x and then against it.
    bearings = np.deg2rad(np.arange(-90, 90))
    ranges = 2.0 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    text = "# comment\nPARAM x 1\n" + flaser(5, 5, 0, ranges) + flaser(5, 5, np.pi, ranges)
    text += flaser(5.1, 5, 0, np.full(180, 81.83)) + flaser(8, 5, 0, np.full(180, 1.0))
    survey, reference = imported("carmen", file("robot.log", text))
    assert [station.id for station in survey.stations] == ["s01", "s02"]
    first, second = (station.scan for station in survey.stations)
    assert len(first.ranges) == 360
    points = first.ranges[:, None] * np.column_stack(
        [np.cos(first.bearings), np.sin(first.bearings)]
    )
    assert np.abs(points).max(axis=1) == pytest.approx(2.0, abs=1e-3)
    assert np.ptp(np.sort(np.diff(np.sort(np.mod(first.bearings, 2 * np.pi))))) < 1e-3
    assert len(second.ranges) == 180
    place = reference.stations["s02"]
    assert (place.x, place.y, place.theta) == (8.0, 5.0, 0.0)


def test_carmen_robotlaser(file):
    line = (
        "ROBOTLASER1 0 -1.570796 3.141593 1.570796 30.0 0.01 0 3 1.5 30.0 2.5 1 7 "
        "1.0 2.0 0.5 1.0 2.0 0.5 0 0 0 0 0 1.0 host 1.0\n"
    )
    survey, reference = imported("carmen", file("robot.clf", line))
    scan = survey.stations[0].scan
    # The middle beam met nothing.
    assert degrees(scan) == pytest.approx([-90.0, 90.0], abs=1e-4)
    assert scan.ranges.tolist() == pytest.approx([1.5, 2.5])
    assert reference.stations["s01"].theta == 0.5


LES = "022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082 est[6.97,5.17,-1.77,53]"


def test_ranges_beside_scans(file):
    scan = file("s01.csv", "angle_deg,range_m\n0,1\n")
    log = file(
        "s01.log", f"12:00:01.2 {LES}\nnoise\n" + '{"ts":1,"uwb":"' + LES + '"}\nDIST,1,AN0\n'
    )
    trek = file("s02.log", "T:142906630:RR:0:1:3780:3790:33:4641\n")
    options = ImportOptions(
        "test",
        tag_height=1.4,
        heights={"022E": 2.4},
        parsers=line_parsers(),
    )
    survey, _ = import_survey(
        "csv", [scan], [("dwm1001-log", log), ("trek1000-log", trek)], options
    )
    assert [station.id for station in survey.stations] == ["s01", "s02"]
    assert {(r.station, r.anchor): r.distances.tolist() for r in survey.ranges} == {
        ("s01", "022E"): [3.38, 3.38],
        ("s01", "9280"): [5.49, 5.49],
        ("s02", "A1"): [3.79],
    }
    assert [(anchor.id, anchor.height) for anchor in survey.anchors] == [
        ("022E", 2.4),
        ("9280", None),
        ("A1", None),
    ]


def test_range_csv(file):
    survey, _ = imported("ranges-csv", file("s01.csv", "time,anchor,range_m\n1,A1,-0.02\n2,A1,2\n"))
    assert survey.ranges[0].distances.tolist() == [-0.02, 2.0]
    assert survey.stations[0].scan is None


def test_ranges_need_the_tag_s_height(file):
    path = file("s01.csv", "anchor,range_m\nA1,2\n")
    with pytest.raises(SlamUwbError, match="height of the tag"):
        import_survey("ranges-csv", [path], [], ImportOptions("test"))


@pytest.mark.parametrize(
    ("form", "name", "text", "told"),
    [
        ("sweep-csv", "s01.csv", "X,Y,Z\n1,2,3\n1,b,3\n", r"s01\.csv:3: Y: .*b.*expected a number"),
        ("sweep-csv", "s01.csv", "X,Y\n1,2\n", r"s01\.csv:1: Z: missing"),
        ("frame-grabber", "s01.txt", "#x\n1.0 2.0 3\n1.0 2,0 3\n", r"s01\.txt:3: Distance: .*2,0"),
        ("frame-grabber", "s01.txt", "1.0 2.0\n", r"s01\.txt:1: .*expected angle"),
        ("csv", "s01.csv", "a,b\n1,2\n", r"s01\.csv:1: .*expected a column of angle_deg"),
        ("carmen", "r.log", "FLASER 180 1 2 3\n", r"r\.log:1: range: 3 values: expected 180"),
        ("carmen", "r.log", "FLASER 2 1 x 0 0 0\n", r"r\.log:1: range\[1\]: .*x"),
        ("carmen", "r.log", "FLASER 99999 1\n", r"r\.log:1: num_readings"),
        ("carmen", "r.log", "ODOM 1 2 3\n", "no FLASER"),
        ("ranges-csv", "s01.csv", "anchor,range_m\nA1,x\n", r"s01\.csv:2: range_m"),
        ("ranges-csv", "s01.csv", "anchor,range_m\n../x,1\n", r"s01\.csv:2: anchor"),
        ("csv", "s01.csv.gz", b"\x1f\x8b\x08broken", "gzip"),
        ("cloud", "s01.xyz", "1 2 3\n", "expected one of"),
    ],
)
def test_faults_name_file_line_and_field(file, form, name, text, told):
    with pytest.raises(SurveyFormatError, match=told):
        imported(form, file(name, text))


def test_names_that_cannot_be_stations(file):
    with pytest.raises(SlamUwbError, match="station"):
        imported("csv", file("a b.csv", "angle_deg,range_m\n0,1\n"))


@pytest.mark.parametrize(
    ("form", "name", "limit"),
    [
        ("sweep-csv", "s01.csv", "200,000,000"),
        ("frame-grabber", "s01.txt", "200,000,000"),
        ("csv", "s01.csv", "200,000,000"),
        ("carmen", "s01.log", "200,000,000"),
        ("dwm1001-log", "s01.log", "200,000,000"),
        ("trek1000-log", "s01.log", "200,000,000"),
        ("ranges-csv", "s01.csv", "200,000,000"),
        ("cloud", "s01.ply", "4,000,000,000"),
        ("cloud", "s01.pcd", "4,000,000,000"),
        ("cloud", "s01.las", "4,000,000,000"),
        ("cloud", "s01.e57", "4,000,000,000"),
    ],
)
def test_ten_gigabytes_of_zeros_are_refused_with_the_limit(tmp_path, form, name, limit):
    # Sparse: it only claims the size. Of a text it is a line as long as that, too.
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(10_000_000_000)
    with pytest.raises(SurveyFormatError, match=f"the limit is {limit}"):
        imported(form, tmp_path / name)


def test_ten_gigabytes_of_zeros_are_no_bag(tmp_path):
    pytest.importorskip("rosbags")
    with (tmp_path / "s01.bag").open("wb") as stream:
        stream.truncate(10_000_000_000)
    with pytest.raises(SurveyFormatError, match="no bag"):
        imported("bag", tmp_path / "s01.bag")


def test_a_path_through_other_folders_names_the_station_by_its_last_part(tmp_path, file):
    file("s01.csv", "angle_deg,range_m\n0,1\n")
    (tmp_path / "a").mkdir()
    survey, _ = imported("csv", tmp_path / "a" / ".." / "s01.csv")
    assert [station.id for station in survey.stations] == ["s01"]
    for name in ("...csv", "..%2Fx.csv", "..\\x.csv"):
        with pytest.raises(SlamUwbError, match="the file's name is its station's"):
            imported("csv", file(name, "angle_deg,range_m\n0,1\n"))


def test_hostile_files_are_refused_with_the_limit(tmp_path, file):
    bomb = file("bomb.csv.gz", gzip.compress(bytes(210_000_000), 9))
    with pytest.raises(SurveyFormatError, match="limit of 200,000,000"):
        imported("csv", bomb)
    long_line = file("long.txt", b"1" * 3_000_000)
    for form in (
        "frame-grabber", "carmen", "csv", "sweep-csv", "ranges-csv", "dwm1001-log", "trek1000-log",
    ):  # fmt: skip
        with pytest.raises(
            SurveyFormatError, match=r"more than [\d,]+ (bytes|characters)|expected"
        ):
            imported(form, long_line)
    with pytest.raises(SurveyFormatError, match="No such file"):
        imported("csv", tmp_path / "none.csv")


SQUARE = np.array([[2.0, 0.0, 0.0], [0.0, 3.0, 0.05], [0.0, 4.0, 0.0], [1.0, 1.0, 0.9]])


def check_cloud(path):
    survey, _ = imported("cloud", path)
    scan = survey.stations[0].scan
    # The nearest of each direction within the band: (0, 4) is hidden, (1, 1) is too high.
    found = sorted(zip(degrees(scan), scan.ranges.round(6).tolist(), strict=True))
    assert found == [(0.0, 2.0), (90.0, 3.0)]


def test_ply_and_pcd(file):
    pytest.importorskip("open3d", exc_type=ImportError)
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in SQUARE)
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        f"property float z\nend_header\n{rows}"
    )
    pcd = (
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n{rows}"
    )
    check_cloud(file("a.ply", ply))
    check_cloud(file("b.pcd", pcd))
    with pytest.raises(SurveyFormatError, match="no points"):
        imported("cloud", file("c.ply", "ply\nnonsense\n"))


def write_las(path):
    laspy = pytest.importorskip("laspy")
    las = laspy.create(point_format=0, file_version="1.2")
    las.header.scales = [0.001] * 3
    las.x, las.y, las.z = SQUARE.T
    las.write(path)


def test_las(tmp_path, file):
    write_las(tmp_path / "s01.las")
    check_cloud(tmp_path / "s01.las")
    whole = (tmp_path / "s01.las").read_bytes()
    # Byte 100 counts records; they would be looked for one by one.
    greedy = whole[:100] + b"\xff" * 4 + whole[104:]
    for spoilt in ("nonsense", greedy, whole[:300]):
        with pytest.raises(SurveyFormatError, match="no LAS"):
            imported("cloud", file("c.las", spoilt))


def test_laz(tmp_path, file):
    pytest.importorskip("lazrs")
    write_las(tmp_path / "s01.laz")
    check_cloud(tmp_path / "s01.laz")
    whole = (tmp_path / "s01.laz").read_bytes()
    with pytest.raises(SurveyFormatError, match="no LAS"):
        imported("cloud", file("c.laz", whole[: len(whole) - 60]))
    # The header's number of points, at byte 107: a thousand million in a file of a few hundred bytes.
    bomb = whole[:107] + (1_000_000_000).to_bytes(4, "little") + whole[111:]
    with pytest.raises(SurveyFormatError, match="claims 1,000,000,000 points, the limit"):
        imported("cloud", file("d.laz", bomb))


def test_a_packed_cloud_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    laspy = pytest.importorskip("laspy")
    write_las(tmp_path / "s01.las")
    packed = bytearray((tmp_path / "s01.las").read_bytes())
    # Packed points have the highest bit of their format set.
    packed[104] |= 0x80
    (tmp_path / "s01.laz").write_bytes(packed)
    monkeypatch.setattr(laspy.LazBackend, "detect_available", staticmethod(lambda: ()))
    with pytest.raises(MissingLibraryError, match=r"slam-uwb\[clouds\]"):
        imported("cloud", tmp_path / "s01.laz")


def test_e57(tmp_path, file):
    pye57 = pytest.importorskip("pye57")
    with pye57.E57(str(tmp_path / "s01.e57"), mode="w") as stream:
        columns = {f"cartesian{axis}": SQUARE[:, k].copy() for k, axis in enumerate("XYZ")}
        stream.write_scan_raw(columns)
    check_cloud(tmp_path / "s01.e57")
    with pytest.raises(SurveyFormatError, match="no E57"):
        imported("cloud", file("c.e57", "nonsense"))


@pytest.mark.parametrize("version", [1, 2])
def test_bags(tmp_path, version):
    pytest.importorskip("rosbags")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if version == 2 else Stores.ROS1_NOETIC)
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    more = {} if version == 2 else {"seq": 0}

    def header(frame):
        return types["std_msgs/msg/Header"](**more, stamp=stamp, frame_id=frame)

    scan = types["sensor_msgs/msg/LaserScan"](
        header("laser"), 0.0, 4.0, np.pi / 2, 0.0, 0.1, 0.15, 12.0,
        np.array([1.0, np.inf, 0.01, 3.0], dtype=np.float32), np.zeros(0, dtype=np.float32),
    )  # fmt: skip
    distance = types["sensor_msgs/msg/Range"](header("A1"), 0, 0.1, 0.0, 50.0, 2.5)
    path = tmp_path / ("s01.bag" if version == 1 else "s01")
    if version == 1:
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
        encode = store.serialize_ros1
    else:
        from rosbags.rosbag2 import Writer

        writer = Writer(path, version=9)
        encode = store.serialize_cdr
    with writer:
        for topic, message in (("/scan", scan), ("/range", distance)):
            kind = message.__msgtype__
            connection = writer.add_connection(topic, kind, typestore=store)
            writer.write(connection, 1, encode(message, kind))
    survey, _ = imported("bag", path)
    station = survey.stations[0]
    assert station.id == "s01"
    assert degrees(station.scan)[:2] == pytest.approx([0.0, 90.0], abs=1e-5)
    assert np.array_equal(station.scan.ranges, [1.0, np.nan, np.nan, 3.0], equal_nan=True)
    assert survey.ranges[0].distances.tolist() == [2.5]


def test_no_bag(file):
    pytest.importorskip("rosbags")
    with pytest.raises(SurveyFormatError, match=r"s01\.bag: no bag"):
        imported("bag", file("s01.bag", "nonsense"))


@pytest.mark.parametrize(
    ("file", "station"),
    [
        ("s01.csv", "s01"), ("S01.CSV.gz", "S01"), ("hall.north.log", "hall.north"),
        ("s.logs", "s.logs"), ("a_1", "a_1"),
    ],
)  # fmt: skip
def test_a_station_is_named_as_its_file_up_to_the_known_ending(file, station):
    assert station_name(Path("folder") / file) == station
