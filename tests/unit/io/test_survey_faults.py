"""Each fault is named with file, line, column and value."""

import gzip
import os
import tracemalloc

import pytest

from slam_uwb.io import check_survey, files, tables

TOML = "survey.toml"
S1 = "scans/s01.csv"
HEAD = "angle_deg,range_m\n"


def the_fault(folder):
    check = check_survey(folder)
    assert check.survey is None
    assert len(check.faults) == 1, "\n".join(map(str, check.faults))
    return str(check.faults[0])


CELLS = {
    "text in a range": (
        {S1: HEAD + "0,1\n90,1.2.3\n"},
        f'{S1}:3: range_m: "1.2.3": expected a number',
    ),
    "grouped digits": ({S1: HEAD + "0,1_0\n"}, f'{S1}:2: range_m: "1_0": expected a number'),
    "digits of another script": (
        {S1: HEAD + "0,\u0663\n"},
        f'{S1}:2: range_m: "\u0663": expected a number',
    ),
    "text in an angle": (
        {S1: HEAD + "0,1\n\neast,1\n"},
        f'{S1}:4: angle_deg: "east": expected a number',
    ),
    "empty angle": ({S1: HEAD + "0,1\n,1\n"}, f"{S1}:3: angle_deg: empty: expected a number"),
    "angle nan": (
        {S1: HEAD + "0,1\nnan,1\n"},
        f'{S1}:3: angle_deg: "nan": expected a finite number',
    ),
    "angle inf": (
        {S1: HEAD + "1e999,1\n0,1\n"},
        f'{S1}:2: angle_deg: "1e999": expected a finite number',
    ),
    "text in an optional column": (
        {S1: "angle_deg,range_m,time_s\n0,1,noon\n"},
        f'{S1}:2: time_s: "noon": expected a number',
    ),
    "too many fields": (
        {S1: HEAD + "0,1\n90,1,5\n"},
        f'{S1}:3: 3 fields in "90,1,5": expected 2 fields',
    ),
    "too few fields": ({S1: HEAD + "0,1\n90\n"}, f'{S1}:3: 1 fields in "90": expected 2 fields'),
    "open quote": (
        {S1: HEAD + '0,"1\n90,1\n'},
        f'{S1}:2: an open quote in "0,\\"1": expected 2 fields',
    ),
    "negative range of a scan": (
        {S1: HEAD + "0,1\n90,-2\n"},
        f"{S1}:3: range_m: -2: expected a distance; 0, empty or nan is no return",
    ),
    "no return": (
        {S1: HEAD + "0,0\n90,\n180,nan\n"},
        f"{S1}: no return at all in 3 rows: every range is 0, empty, nan or over 25 m",
    ),
    "no row": (
        {S1: HEAD},
        f"{S1}: no return at all in 0 rows: every range is 0, empty, nan or over 25 m",
    ),
    "missing column": (
        {S1: "angle_deg,distance\n0,1\n"},
        f'{S1}:1: range_m: missing: the header is "angle_deg,distance", expected angle_deg,range_m',
    ),
    "column twice": (
        {S1: "angle_deg,range_m,range_m\n0,1,1\n"},
        f"{S1}:1: range_m: is there 2 times: expected once",
    ),
    "not UTF-8": (
        {S1: b"angle_deg,range_m\n0,1\n1,\xe9\n"},
        f"{S1}:3: byte 0xE9: expected UTF-8 text",
    ),
    "text in a range of ranges.csv": (
        {"ranges.csv": "station,anchor,range_m\ns01,A1,3\ns02,A1,far\n"},
        'ranges.csv:3: range_m: "far": expected a number',
    ),
    "unknown station": (
        {"ranges.csv": "station,anchor,range_m\ns01,A1,3\ns99,A1,3\ns99,A1,4\n"},
        'ranges.csv:3: station: "s99": no such station in survey.toml (2 rows, this is the first)',
    ),
    "empty period": (
        {"twr.csv": "station,anchor,t1_s,t2_s,t3_s,t4_s\ns01,A1,1e-3,,1e-3,1e-3\n"},
        "twr.csv:2: t2_s: empty: expected a number",
    ),
    "anchor to itself": (
        {"anchor_ranges.csv": "anchor_a,anchor_b,range_m\nA1,A1,3\n"},
        'anchor_ranges.csv:2: anchor_b: "A1": an anchor has no distance to itself',
    ),
}
DECISION = "kind,a,b,decision,dx_m,dy_m,dyaw_deg\n"
DECISIONS = {
    "kind": ("scan,s01,s02,keep,,,", 'kind: "scan": expected pair or link'),
    "station": ("pair,s01,s03,keep,,,", 'b: "s03": no such station'),
    "anchor": ("link,s01,A9,keep,,,", 'b: "A9": no such anchor'),
    "verdict": ("link,s01,A1,guess,1,1,1", 'decision: "guess": expected keep or drop for a link'),
    "guess": ("pair,s01,s02,guess,1,,1", "dy_m: nan: a guess needs a finite number"),
    "itself": ("pair,s01,s01,keep,,,", 'b: "s01": expected another station than a'),
}
IDENTIFIER = "expected an identifier: 1 to 64 of A-Z a-z 0-9 _ . -"
KEYS = {
    "format": (("format = 1", "format = 2"), ":1: format = 2: expected format = 1"),
    "format as text": (("format = 1", 'format = "1"'), ':1: format = "1": expected format = 1'),
    "no format": (("format = 1\n", ""), ": format is missing: expected format = 1"),
    "TOML syntax": (
        ('id = "A1"', "id = A1"),
        ":21: no TOML: Invalid value (at line 21, column 6)",
    ),
    "number as text": (
        ('id = "s02"', 'id = "s02"\nx_m = "abc"\ny_m = 1'),
        ':18: stations[1].x_m = "abc": expected a number',
    ),
    "truth as number": (
        ('id = "s02"', 'id = "s02"\ntag_height_m = true'),
        ":18: stations[1].tag_height_m = true: expected a number",
    ),
    "not finite": (
        ("height_m = 2.4", "height_m = nan"),
        ":22: anchors[0].height_m = NaN: expected a finite number",
    ),
    "height in cm": (
        ("height_m = 2.4", "height_m = 240"),
        ":22: anchors[0].height_m = 240: expected at most 50",
    ),
    "tag height in cm": (
        ("height_m = 1.4", "height_m = 140"),
        ":10: tag.height_m = 140: expected at most 50",
    ),
    "identifier as number": (
        ('id = "A1"', "id = 1"),
        ":21: anchors[0].id = 1: expected text in quotes",
    ),
    "identifier": (('id = "A1"', 'id = "A 1"'), f':21: anchors[0].id = "A 1": {IDENTIFIER}'),
    "long identifier": (
        ('id = "A1"', f'id = "{"a" * 65}"'),
        f':21: anchors[0].id = "{"a" * 59}...: {IDENTIFIER}',
    ),
    "missing id": (
        ('id = "A1"\n', ""),
        ":20: anchors[0].id: required, but missing",
    ),
    "station twice": (
        ("[[anchors]]", '[[stations]]\nid = "s01"\n\n[[anchors]]'),
        ':21: stations[2].id = "s01": this station is there twice',
    ),
    "anchor twice": (
        ("height_m = 2.4", 'height_m = 2.4\n[[anchors]]\nid = "A1"'),
        ':24: anchors[1].id = "A1": this anchor is there twice',
    ),
    "radio of another": (
        ("height_m = 2.4", 'height_m = 2.4\n[[anchors]]\nid = "A2"\nradio = "A1"'),
        ':25: anchors[1].radio = "A1": anchor A1 has this identifier',
    ),
    "sequence of nobody": (
        ('["s01", "s02"]', '["s01", "s03"]'),
        ':3: sequence[0][1] = "s03": no such station',
    ),
    "sequence to itself": (
        ('["s01", "s02"]', '["s01", "s01"]'),
        ':3: sequence[0] = ["s01", "s01"]: expected two different stations',
    ),
    "sequence of three": (
        ('["s01", "s02"]', '["s01", "s02", "s01"]'),
        ':3: sequence[0] = ["s01", "s02", "s01"]: expected a pair of stations',
    ),
    "no direction": (
        ('angle_direction = "ccw"\n', ""),
        ":5: lidar.angle_direction: required, but missing",
    ),
    "direction": (
        ('"ccw"', '"left"'),
        ':6: lidar.angle_direction = "left": expected "ccw" or "cw"',
    ),
    "no lidar": (
        ('[lidar]\nangle_direction = "ccw"\nmax_range_m = 25.0\n', ""),
        ": lidar: required, but missing: stations have scans",
    ),
    "no tag": (("[tag]\nheight_m = 1.4\n", ""), ": tag: required, but missing: there are ranges"),
    "no tag height": (
        ("height_m = 1.4\n", ""),
        ":9: tag.height_m: required, but missing: not every station has tag_height_m",
    ),
    "max range": (
        ("max_range_m = 25.0", "max_range_m = 0"),
        ":7: lidar.max_range_m = 0: expected more than 0",
    ),
    "x without y": (
        ('id = "s02"', 'id = "s02"\nx_m = 1'),
        ":18: stations[1].x_m without y_m: expected both or none",
    ),
    "yaw alone": (
        ('id = "s02"', 'id = "s02"\nyaw_deg = 1'),
        ":18: stations[1].yaw_deg without x_m and y_m: expected all three",
    ),
    "upper scan alone": (
        ('scan = "scans/s02.csv"', 'upper_scan = "scans/s02.csv"'),
        ":18: stations[1].upper_scan without scan: a single recording is the station's scan",
    ),
    "more than any float holds": (
        ('id = "s02"', f'id = "s02"\nx_m = 1{"0" * 400}\ny_m = 1'),
        f":18: stations[1].x_m = 1{'0' * 59}...: expected a number",
    ),
    "a scan that is no name": (
        ('scan = "scans/s02.csv"', "scan = 2"),
        ":18: stations[1].scan = 2: expected a list",
    ),
    "a table where tables belong": (
        ("[[anchors]]", "[anchors]"),
        ':20: anchors = {"id": "A1", "height_m": 2.4}: expected [[anchors]] tables',
    ),
}


@pytest.mark.parametrize("case", CELLS)
def test_row(make_survey, case):
    changes, expected = CELLS[case]
    assert the_fault(make_survey(changes)) == expected


@pytest.mark.parametrize("case", DECISIONS)
def test_decision(make_survey, case):
    row, expected = DECISIONS[case]
    folder = make_survey({"decisions.csv": DECISION + row + "\n"})
    assert the_fault(folder) == f"decisions.csv:2: {expected}"


def test_pair_decided_twice(make_survey):
    rows = "pair,s01,s02,keep,,,\npair,s02,s01,drop,,,\n"
    fault = the_fault(make_survey({"decisions.csv": DECISION + rows}))
    assert fault == "decisions.csv:3: pair s02, s01 was already decided in line 2"


@pytest.mark.parametrize("case", KEYS)
def test_key(make_survey, case):
    change, expected = KEYS[case]
    assert the_fault(make_survey({TOML: change})) == f"{TOML}{expected}"


def test_no_line_is_better_than_a_wrong_one(make_survey):
    """A header inside a string would shift the count of the tables."""
    text = (make_survey(folder="text") / TOML).read_text()
    text = text.replace('id = "s02"', 'id = "s02"\ntag_height_m = 99')
    notes = 'x_notes = """\n[[stations]]\n"""\n[lidar]'
    assert the_fault(make_survey({TOML: text})).startswith(f"{TOML}:18: stations[1].tag_height_m")
    folder = make_survey({TOML: text.replace("[lidar]", notes)}, "noted")
    assert the_fault(folder).startswith(f"{TOML}: stations[1].tag_height_m = 99")


def test_lever_arm_without_heading(make_survey):
    text = (make_survey(folder="text") / TOML).read_text()
    text = text.replace("height_m = 1.4", "height_m = 1.4\noffset_x_m = 0.3\noffset_y_m = 0.4")
    text = text.replace('scan = "scans/s02.csv"', "x_m = 1\ny_m = 2")
    fault = the_fault(make_survey({TOML: text}))
    assert fault.startswith(f"{TOML}:18: stations[1].yaw_deg: required, but missing")
    assert "0.5 m off" in fault
    with_heading = text.replace("y_m = 2", "y_m = 2\nyaw_deg = 30")
    assert check_survey(make_survey({TOML: with_heading}, "turned")).faults == ()


def test_header_with_semicolons_is_explained(make_survey):
    check = check_survey(make_survey({S1: "angle_deg;range_m\n0;1\n"}))
    assert [fault.column for fault in check.faults] == ["angle_deg", "range_m"]
    assert "columns are separated by commas" in str(check.faults[0])


def test_thousands_of_faults_are_counted(make_survey):
    check = check_survey(make_survey({S1: HEAD + "0,x\n" * 1000}))
    assert len(check.faults) == 21
    assert str(check.faults[-1]) == f"{S1}: range_m: 980 more of these"


def test_no_station(make_survey):
    folder = make_survey({TOML: 'format = 1\nname = "x"\n', "ranges.csv": None})
    assert the_fault(folder) == f"{TOML}: stations: expected at least one [[stations]] table"


def test_name_longer_than_the_file_system_allows(make_survey):
    name = "s" * 300 + ".csv"
    fault = the_fault(make_survey({TOML: ("scans/s01.csv", name)}))
    assert fault == f"{name}: cannot be read: File name too long"


def test_survey_is_a_file(make_survey):
    path = make_survey() / TOML
    assert the_fault(path) == f"{path}: is no folder"


def test_missing_folder(tmp_path):
    assert the_fault(tmp_path / "none") == f"{tmp_path / 'none'}: no such folder"


def test_missing_survey_toml(make_survey):
    assert the_fault(make_survey({TOML: None})) == f"{TOML}: no such file"


def test_missing_scan(make_survey):
    assert the_fault(make_survey({S1: None})) == f"{S1}: no such file"


def test_survey_toml_not_utf8(make_survey):
    folder = make_survey({TOML: b'format = 1\nname = "B\xfcro"\n'})
    assert the_fault(folder) == f"{TOML}:2: byte 0xFC: expected UTF-8 text"


def test_deeply_nested_toml(make_survey):
    fault = the_fault(make_survey({TOML: "x = " + "[" * 20_000}))
    assert fault == f"{TOML}: no TOML: nested too deeply"


@pytest.mark.parametrize("name", ["../secret.csv", "/etc/passwd", "scans/../../secret.csv", "C:/x"])
def test_path_that_leaves(make_survey, tmp_path, name):
    (tmp_path / "secret.csv").write_text(HEAD + "0,1\n")
    folder = make_survey({TOML: ("scans/s01.csv", name)})
    expected = "leaves the folder: expected a path relative to it, without '..'"
    assert the_fault(folder) == f"{name}: {expected}"


def test_link_that_leaves(make_survey, tmp_path):
    outside = tmp_path / "outside.csv"
    outside.write_text(HEAD + "0,1\n")
    folder = make_survey({S1: None})
    (folder / S1).symlink_to(outside)
    assert the_fault(folder) == f"{S1}: is a link that leaves the folder: copy the file here"
    (folder / S1).unlink()
    (folder / S1).symlink_to("s02.csv")
    assert check_survey(folder).faults == ()


def test_link_to_itself(make_survey):
    folder = make_survey({S1: None})
    (folder / S1).symlink_to("s01.csv")
    assert the_fault(folder).startswith(f"{S1}: cannot be read: ")


def test_no_regular_file(make_survey):
    folder = make_survey({S1: None})
    os.mkfifo(folder / S1)
    assert the_fault(folder) == f"{S1}: is no regular file"


def test_control_characters_do_not_reach_the_terminal(make_survey):
    folder = make_survey({TOML: ("scans/s01.csv", "s\\u001b[2J.csv")})
    assert "\x1b" not in the_fault(folder)


def test_both_plain_and_compressed(make_survey):
    folder = make_survey()
    (folder / "ranges.csv.gz").write_bytes(gzip.compress((folder / "ranges.csv").read_bytes()))
    assert (
        the_fault(folder) == "ranges.csv: ranges.csv and ranges.csv.gz are both there: remove one"
    )


def test_torn_gzip(make_survey):
    packed = gzip.compress((HEAD + "0,1\n" * 1000).encode())
    folder = make_survey({S1: None, S1 + ".gz": packed[:-9]})
    assert the_fault(folder).startswith(f"{S1}.gz: is no whole gzip file: ")


def test_text_that_claims_to_be_gzip(make_survey):
    folder = make_survey({S1: None, S1 + ".gz": HEAD + "0,1\n"})
    assert the_fault(folder).startswith(f"{S1}.gz: is no whole gzip file: ")


def test_gzip_bomb_is_not_expanded(make_survey):
    # 300 MB of newlines are 0.3 MB packed: above the limit, and found by counting, not keeping.
    packed = gzip.compress(b"\n" * 300_000_000, 1)
    folder = make_survey({S1: None, S1 + ".gz": packed})
    limit = f"{files.MAX_FILE_BYTES:,}"
    tracemalloc.start()
    fault = the_fault(folder)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert fault == f"{S1}.gz: uncompresses to more than the limit of {limit} bytes"
    assert peak < 30_000_000


@pytest.mark.parametrize("size", [files.MAX_FILE_BYTES + 1, 1_000_000_000, 10_000_000_000])
@pytest.mark.parametrize(
    ("name", "limit"), [(S1, "200,000,000"), ("ranges.csv", "200,000,000"), (TOML, "4,000,000")]
)
def test_oversize_file(make_survey, name, limit, size):
    folder = make_survey()
    # A sparse file: it only claims the size; without a line's end, it is a line as long as that, too.
    with (folder / name).open("r+b") as stream:
        stream.truncate(size)
    assert the_fault(folder) == f"{name}: holds {size:,} bytes, the limit is {limit}"


def test_long_line(make_survey):
    folder = make_survey({S1: HEAD + "0,1\n" + "9" * (tables.MAX_LINE_CHARACTERS + 1) + ",1\n"})
    expected = f"{S1}:3: a line of more than 10,000 characters: expected a CSV file"
    assert the_fault(folder) == expected
