import base64
import json
import re
import tracemalloc
import zlib
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from PIL import Image

import slam_uwb.io
from slam_uwb.io import read_settings, read_solution, write_solution
from slam_uwb.io.floor_map_files import unpack
from slam_uwb.io.solution_document import solution_schema
from slam_uwb.model.errors import SlamUwbError, SurveyFormatError
from slam_uwb.model.floor import FloorMap
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement, ScanMatch
from slam_uwb.model.settings import PRESETS
from slam_uwb.model.solution import (
    Alternative,
    AnchorEstimate,
    Bias,
    Continuation,
    Move,
    Solution,
    SolverChecks,
    StationEstimate,
    Status,
)
from slam_uwb.model.survey import Scan

SCHEMA = Path(slam_uwb.io.__file__).with_name("solution.schema.json")
FILES = {
    "alternatives.csv", "anchors.csv", "links.csv", "map.png", "map.yaml", "matches.csv",
    "settings.toml", "solution.json", "stations.csv",
}  # fmt: skip
NAN = float("nan")


@pytest.fixture
def solution():
    occupancy = np.array([[0.9, 0.1, np.nan], [0.5, 0.004, 1.0]])
    # Facing +y, s02's own x axis is the world's y.
    own = np.diag([0.01, 0.04, np.deg2rad(2.0)]) ** 2
    return Solution(
        survey_name="two rooms, one corridor",
        checksum="ab" * 32,
        mode="joint",
        settings=PRESETS["paper"],
        software_version="0.0.0",
        frame="s01",
        stations=(
            StationEstimate("s01", Pose2(0.0, 0.0, 0.0), np.zeros((3, 3)), Status.OK),
            StationEstimate("s02", Pose2(1.5, -0.00001, np.pi / 2), own, Status.OK),
            StationEstimate("s03", Pose2(2.0, 3.0, 0.0), own, Status.OK, heading_known=False),
            StationEstimate("s04", None, None, Status.DISCONNECTED),
            StationEstimate(
                "s05",
                None,
                None,
                Status.AMBIGUOUS,
                alternatives=(Alternative(1.0, 2.0, np.pi / 4, 0.75), Alternative(3, 4, None, NAN)),
            ),
        ),
        anchors=(
            AnchorEstimate("A1", [3.0, 4.0], [[0.04, -0.01], [-0.01, 0.09]], 2.45, 5, Status.OK),
            AnchorEstimate("A2", None, None, None, 1, Status.UNREACHABLE),
            AnchorEstimate(
                "A3",
                [1.0, 1.0],
                np.eye(2),
                2.0,
                4,
                Status.MIRROR_AMBIGUOUS,
                alternatives=(Alternative(1.0, -1.0, None, 0.4),),
            ),
        ),
        matches=(
            ScanMatch("s01", "s02", Pose2(1.5, 0.0, np.pi / 2), own, 0.6, 0.001, 12.5, 0),
            ScanMatch(
                "s01",
                "s02",
                Pose2(0.0, 1.0, 0.0),
                np.full((3, 3), np.nan),
                NAN,
                0.2,
                -3.0,
                1,
                degenerate=True,
                rejection='looked through walls, "twice"',
            ),
        ),
        links=(
            LinkMeasurement("s01", "A1", 5.25, 5.26, 0.1, 100, 2, 0.12, 1.0, 0.25),
            LinkMeasurement("s02", "A2", NAN, NAN, 0.1, 0, 7, rejection="no usable sample"),
        ),
        biases=(Bias("offset", 0.15, 0.02, 0.18, 0.1),),
        joint_names=("s02", "A1"),
        joint_covariance=np.arange(25.0).reshape(5, 5) / 7.0,
        checks=SolverChecks(1e-5, 2e-4, 3, 12.3),
        floor_map=FloorMap(occupancy, 0.05, (-1.25, 2.5)),
        scans={"s01": Scan(np.array([0.1, 0.2]), np.array([1.0 / 3.0, np.nan]), 40.0)},
        tag_offset=(0.1, -0.2),
        warnings=("anchor A2: heard once",),
        picture=FloorMap(np.array([[0.0, 1.0], [0.5, 0.25]]), 0.02, (0.0, 0.0)),
        continued=Continuation(
            checksum="cd" * 32,
            added=("s05",),
            seen_from="s02",
            moves=(
                Move("station", "s02", 0.003, 0.02, 0.01, Status.OK, Status.OK),
                Move("anchor", "A2", NAN, NAN, 0.3, Status.UNREACHABLE, Status.OK),
            ),
        ),
    )


def assert_equal(a, b, path="solution"):
    """Field by field, NaN equal to NaN; the map within its steps."""
    if is_dataclass(a):
        assert type(a) is type(b), path
        for item in fields(a):
            assert_equal(getattr(a, item.name), getattr(b, item.name), f"{path}.{item.name}")
    elif isinstance(a, np.ndarray):
        atol = 0.002 if path.endswith("occupancy") else 0.0
        np.testing.assert_allclose(a, b, rtol=0.0, atol=atol, err_msg=path)
    elif isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            assert_equal(a[key], b[key], f"{path}[{key}]")
    elif isinstance(a, tuple):
        assert len(a) == len(b), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_equal(x, y, f"{path}[{i}]")
    else:
        assert a == b or (a != a and b != b), path


def lines(out, name):
    return (out / name).read_text().splitlines()


def test_reads_back_the_same_from_solution_json_alone(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    for file in FILES - {"solution.json"}:
        (tmp_path / "out" / file).unlink()
    assert_equal(read_solution(tmp_path / "out"), solution)


def test_written_again_gives_the_same_bytes(solution, tmp_path):
    write_solution(solution, tmp_path / "one")
    write_solution(read_solution(tmp_path / "one"), tmp_path / "two")
    assert {path.name for path in (tmp_path / "one").iterdir()} == FILES
    for name in FILES:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), (
            name
        )


def test_stations_csv(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    # s02 faces +y: its own sigmas (0.01 along its x, 0.04 along its y) swap in the world.
    assert lines(tmp_path / "out", "stations.csv") == [
        "station,x_m,y_m,yaw_deg,sigma_x_m,sigma_y_m,sigma_yaw_deg,status",
        "s01,0.0000,0.0000,0.0000,0.000000,0.000000,0.000000,ok",
        "s02,1.5000,0.0000,90.0000,0.040000,0.010000,2.000000,ok",
        "s03,2.0000,3.0000,,0.010000,0.040000,,ok",
        "s04,,,,,,,disconnected",
        "s05,,,,,,,ambiguous",
    ]


def test_sigmas_turn_with_the_station(solution, tmp_path):
    # At 45 degrees x_world = (x - y) / sqrt(2), so its variance is (vx + vy) / 2 - cov, and that
    # of y_world is (vx + vy) / 2 + cov: 0.25 -+ 0.09 are the squares of 0.4 and 0.583095.
    own = np.diag([0.25, 0.25, 0.0])
    own[0, 1] = own[1, 0] = 0.09
    station = StationEstimate("s01", Pose2(0.0, 0.0, np.pi / 4), own, Status.OK)
    write_solution(replace(solution, stations=(station,)), tmp_path / "out")
    row = lines(tmp_path / "out", "stations.csv")[1]
    assert row == "s01,0.0000,0.0000,45.0000,0.400000,0.583095,0.000000,ok"


def test_anchors_csv(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    assert lines(tmp_path / "out", "anchors.csv") == [
        "anchor,x_m,y_m,z_m,sigma_x_m,sigma_y_m,cov_xy_m2,stations,status",
        "A1,3.0000,4.0000,2.4500,0.200000,0.300000,-0.01000000,5,ok",
        "A2,,,,,,,1,unreachable",
        "A3,1.0000,1.0000,2.0000,1.000000,1.000000,0.00000000,4,mirror-ambiguous",
    ]


def test_alternatives_csv(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    assert lines(tmp_path / "out", "alternatives.csv") == [
        "kind,id,rank,x_m,y_m,yaw_deg,weight",
        "station,s05,1,1.0000,2.0000,45.0000,0.7500",
        "station,s05,2,3.0000,4.0000,,",
        "anchor,A3,1,1.0000,-1.0000,,0.4000",
    ]


def test_links_csv(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    assert lines(tmp_path / "out", "links.csv") == [
        "station,anchor,samples,range_m,sigma_m,residual_m,walls,nlos_probability,used,reason",
        "s01,A1,100,5.2500,0.100000,0.1200,1.000,0.2500,true,",
        "s02,A2,0,,0.100000,,,,false,no usable sample",
    ]


def test_matches_csv(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    header, *rest = lines(tmp_path / "out", "matches.csv")
    assert header.split(",")[:6] == ["station_m", "station_n", "rank", "dx_m", "dy_m", "dyaw_deg"]
    assert header.endswith(",sigma_x_m,sigma_y_m,sigma_yaw_deg,overlap,violation,used,reason")
    # Sigmas stay in n's own axes.
    assert rest == [
        "s01,s02,0,1.5000,0.0000,90.0000,0.010000,0.040000,2.000000,0.6000,0.0010,true,",
        's01,s02,1,0.0000,1.0000,0.0000,,,,,0.2000,false,"looked through walls, ""twice"""',
    ]


def test_map_is_what_map_server_reads(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    with Image.open(tmp_path / "out" / "map.png") as image:
        assert image.mode == "L"
        grey = np.array(image)
    # The picture's top row is the grid's last: the largest y.
    np.testing.assert_array_equal(grey, [[205, 254, 0], [0, 254, 205]])
    assert (tmp_path / "out" / "map.yaml").read_text() == (
        "image: map.png\nresolution: 0.050000\norigin: [-1.250000, 2.500000, 0.000000]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    # As map_server takes it: occupancy is (255 - grey) / 255 against the two thresholds.
    occupancy = (255 - grey) / 255
    assert (occupancy[grey == 0] > 0.65).all()
    assert (occupancy[grey == 254] < 0.196).all()
    assert ((occupancy[grey == 205] > 0.196) & (occupancy[grey == 205] < 0.65)).all()


def test_without_map(solution, tmp_path):
    write_solution(replace(solution, floor_map=None), tmp_path / "out")
    assert read_solution(tmp_path / "out").floor_map is None
    with Image.open(tmp_path / "out" / "map.png") as image:
        assert np.array(image).tolist() == [[205]]


def test_settings_toml_is_resolved(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    assert read_settings(tmp_path / "out" / "settings.toml") == PRESETS["paper"]


def test_nothing_unknown_is_written_as_a_number(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    for name in FILES - {"map.png", "settings.toml"}:
        text = (tmp_path / "out" / name).read_text().lower()
        assert "nan" not in text.replace("looked", "")
        # A word may hold it (anchor_inflation), a number may not.
        assert re.search(r"\binf", text) is None


def test_schema_is_up_to_date():
    regenerate = (
        'python -c "from slam_uwb.io.solution_document import solution_schema as s; '
        "print(s(), end='')\" > slam_uwb/io/solution.schema.json"
    )
    assert SCHEMA.read_text() == solution_schema(), f"run: {regenerate}"


def test_written_solutions_follow_the_schema(solution, tmp_path):
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    bare = replace(
        solution, joint_covariance=None, checks=None, floor_map=None, scans={}, matches=()
    )
    for item in (solution, bare):
        write_solution(item, tmp_path / "out")
        document = json.loads((tmp_path / "out" / "solution.json").read_text())
        validator.validate(document)
        # The schema does tell something: without its stations it is no solution.
        del document["stations"]
        assert not validator.is_valid(document)


def test_extras(solution, tmp_path):
    write_solution(solution, tmp_path / "out", {"figures/map.svg": b"<svg/>"})
    assert (tmp_path / "out" / "figures" / "map.svg").read_bytes() == b"<svg/>"
    with pytest.raises(ValueError, match=r"map.png: files of the solution itself"):
        write_solution(solution, tmp_path / "out", {"map.png": b""})
    assert (tmp_path / "out" / "figures" / "map.svg").exists()


def test_old_solution_is_replaced_with_all_that_is_in_it(solution, tmp_path):
    write_solution(solution, tmp_path / "out", {"old.txt": b""})
    write_solution(solution, tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("mark", ["notes.txt", "survey.toml"])
def test_foreign_folder_is_refused(solution, tmp_path, mark):
    (tmp_path / mark).write_text("mine")
    message = "exists and is no solution folder: nothing was changed"
    with pytest.raises(SlamUwbError, match=message) as raised:
        write_solution(solution, tmp_path)
    assert raised.value.exit_status == 2
    assert [path.name for path in tmp_path.iterdir()] == [mark]


def test_survey_with_a_solution_in_it_is_refused(solution, tmp_path):
    write_solution(solution, tmp_path / "out")
    (tmp_path / "out" / "survey.toml").write_text("format = 1")
    with pytest.raises(SlamUwbError, match="is a survey folder: nothing was changed"):
        write_solution(solution, tmp_path / "out")
    assert (tmp_path / "out" / "survey.toml").exists()


def test_file_in_the_way_is_refused(solution, tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(SlamUwbError, match="nothing was changed"):
        write_solution(solution, tmp_path / "out")
    assert (tmp_path / "out").read_text() == "mine"


def test_empty_folder_is_taken(solution, tmp_path):
    (tmp_path / "out").mkdir()
    write_solution(solution, tmp_path / "out")
    assert (tmp_path / "out" / "solution.json").is_file()


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (lambda text: text[:1000], "solution.json: Invalid JSON: EOF while parsing"),
        (lambda text: text.replace('"format":1', '"format":2'), "solution.json: format = 2: "),
        (lambda text: text.replace('"mode":"joint",', ""), "solution.json: mode: Field required"),
        (
            lambda text: text.replace('"status":"unreachable"', '"status":"fine"'),
            'solution.json: anchors[1].status = "fine": ',
        ),
        (
            lambda text: text.replace('"x_m":1.5', '"x_m":"1.5"', 1),
            'solution.json: stations[1].world_T_station.x_m = "1.5": ',
        ),
        (
            lambda text: text.replace('"names":["s02","A1"],"covariance":[[', '"covariance":[[9,'),
            "solution.json: joint.names: Field required",
        ),
        (
            lambda text: text.replace('"covariance":[[0.0,0.14', '"covariance":[[9,0.0,0.14'),
            "solution.json: joint.covariance: expected 5 numbers in each of its rows",
        ),
        (
            lambda text: text.replace('"width":3', '"width":4'),
            "solution.json: floor_map.cells: does not hold the 8 cells of a 2 x 4 map",
        ),
        (
            lambda text: text.replace('"width":3', '"width":3000000000'),
            "solution.json: floor_map.cells: 6,000,000,000 cells, the limit is 100,000,000",
        ),
        (
            lambda text: text.replace('"cells":"', '"cells":"!'),
            "solution.json: floor_map.cells: no zlib data in base64: ",
        ),
        (
            lambda text: text.replace('"bin_deg":1.0', '"bin_deg":-1.0'),
            "solution.json: settings: scan.bin_deg: Input should be greater than 0",
        ),
        (
            lambda text: text.replace('"bearings_rad":[0.1,', '"bearings_rad":['),
            "solution.json: ranges has shape (2,), expected (1,)",
        ),
    ],
)
def test_damaged_solution_json(solution, tmp_path, damage, expected):
    write_solution(solution, tmp_path / "out")
    path = tmp_path / "out" / "solution.json"
    text = path.read_text()
    path.write_text(damage(text))
    assert path.read_text() != text
    with pytest.raises(SurveyFormatError) as raised:
        read_solution(tmp_path / "out")
    assert str(raised.value).startswith(expected)
    assert len(str(raised.value).splitlines()) == 1


def test_map_bomb_is_not_expanded():
    bomb = base64.b64encode(zlib.compress(bytes(100_000_000))).decode()
    tracemalloc.start()
    with pytest.raises(ValueError, match="does not hold the 6 cells of a 2 x 3 map"):
        unpack(bomb, 2, 3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


def test_missing_solution(tmp_path):
    with pytest.raises(SurveyFormatError, match=r"solution\.json: no such file"):
        read_solution(tmp_path)
    with pytest.raises(SurveyFormatError, match="none: no such folder"):
        read_solution(tmp_path / "none")
