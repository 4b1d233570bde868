"""Every export read back by a reader that is not ours, or by its format's rule restated."""

import csv
import io
import json
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from shapely.geometry import shape

from slam_uwb.io.exporters import ANCHOR_EXPORTERS, EXPORTERS, export_solution
from slam_uwb.io.exporters.anchors import left_out
from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.floor import FloorMap, FloorPlan, Room, Wall
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.products import LinkMeasurement, ScanMatch
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import AnchorEstimate, Bias, Solution, StationEstimate, Status
from slam_uwb.model.survey import Scan

MAP = np.full((4, 6), np.nan)
MAP[1, 1:5] = 0.98
MAP[2, 1:5] = 0.03
COVARIANCE = np.array([[4e-4, 1e-4, 2e-5], [1e-4, 9e-4, -3e-5], [2e-5, -3e-5, 1e-4]])


@pytest.fixture
def solution():
    """Two stations 3 m apart, the second turned by 90 degrees; three anchors, one of them in doubt."""
    stations = (
        StationEstimate("s01", Pose2(0.0, 0.0, 0.0), np.eye(3) * 1e-6, Status.OK),
        StationEstimate("s02", Pose2(3.0, 1.0, math.pi / 2), np.eye(3) * 1e-4, Status.OK),
        StationEstimate("s03", None, None, Status.DISCONNECTED),
    )
    anchors = (
        AnchorEstimate("022E", np.array([4.0, 1.0]), np.eye(2) * 0.01, 2.4, 2, Status.OK),
        AnchorEstimate("B<&", np.array([1.0, -2.0004]), np.eye(2) * 0.01, 2.0, 2, Status.OK),
        AnchorEstimate("C", np.array([9.0, 9.0]), np.eye(2), 2.0, 2, Status.MIRROR_AMBIGUOUS),
        AnchorEstimate("D", None, None, 2.0, 0, Status.UNREACHABLE),
    )
    return Solution(
        survey_name="two & <rooms>", checksum="", mode="joint", settings=Settings(), software_version="1",
        frame="s01", stations=stations, anchors=anchors,
        matches=(
            ScanMatch("s01", "s02", Pose2(3.0, 1.0, math.pi / 2), COVARIANCE, 0.4, 0.0, 8.0, 0),
            ScanMatch("s01", "s02", Pose2(1.0, 0.0, 0.0), COVARIANCE, 0.1, 0.1, 1.0, 1, rejection="no"),
        ),
        # 5 m slant with 0.2 m of offset and 1.0 m of rise: sqrt(4.8^2 - 1) flat.
        links=(
            LinkMeasurement("s01", "022E", 5.0, 5.0, 0.1, 60, residual=0.0),
            LinkMeasurement("s02", "022E", 5.0, 5.0, 0.1, 60, rejection="fault"),
        ),
        biases=(Bias("range offset", 0.2, 0.05, 0.18, 0.1),), joint_names=(), joint_covariance=None,
        checks=None, floor_map=FloorMap(MAP, 0.5, (-1.0, -0.5)),
        scans={"s02": Scan(np.array([0.0, 0.5, math.pi / 2]), np.array([2.0, np.nan, 1.0]), 40.0)},
        tag_heights={"s01": 1.4, "s02": 1.4},
        plan=FloorPlan(
            rooms=(Room(np.array([[0, 0], [4, 0], [4, 3], [0, 3]], float), 12.0),),
            walls=(
                Wall(np.array([[0, -0.1], [4, -0.1]]), 0.2, 0.97),
                Wall(np.array([[0, 3], [4, 3]], float), math.nan, 0.9),
            ),
            doors=np.array([[[1.0, 3.0], [1.9, 3.0]]]),
        ),
    )  # fmt: skip


def only(solution, name):
    (content,) = (d for n, d in EXPORTERS[name](solution).items() if not n.endswith("names.csv"))
    return content


def test_dxf_is_sound_and_in_metres(solution, tmp_path):
    import ezdxf

    path = tmp_path / "floor.dxf"
    path.write_bytes(only(solution, "dxf"))
    document = ezdxf.readfile(path)
    assert document.dxfversion == "AC1024"  # R2010
    assert document.units == ezdxf.units.M
    auditor = document.audit()
    assert (auditor.errors, auditor.fixes) == ([], [])
    space = document.modelspace()
    (room,) = space.query('LWPOLYLINE[layer=="ROOMS"]')
    assert [tuple(p[:2]) for p in room] == [(0, 0), (4, 0), (4, 3), (0, 3)]
    (wall,) = space.query('LWPOLYLINE[layer=="WALLS"]')
    # 0.2 m round the centre line at y = -0.1.
    assert sorted({round(p[1], 9) for p in wall}) == [-0.2, 0.0]
    assert len(space.query('LINE[layer=="WALLS"]')) == 1
    assert {text.dxf.text for text in space.query('TEXT[layer=="ANCHORS"]')} == {"022E", "B<&", "C"}
    circle = next(iter(space.query('CIRCLE[layer=="ANCHORS"]')))
    assert tuple(circle.dxf.center) == (4.0, 1.0, 2.4)
    assert {text.dxf.text for text in space.query('TEXT[layer=="STATIONS"]')} == {"s01", "s02"}
    assert {"WALLS", "ROOMS", "ANCHORS", "STATIONS"} <= {
        layer.dxf.name for layer in document.layers
    }


def test_geojson_by_shapely(solution):
    content = json.loads(only(solution, "geojson"))
    shapes = {}
    for feature in content["features"]:
        found = shape(feature["geometry"])
        assert found.is_valid
        shapes.setdefault(feature["properties"]["kind"], []).append((found, feature["properties"]))
    assert shapes["room"][0][0].area == 12.0
    assert [p["thickness_m"] for _, p in shapes["wall"]] == [0.2, None]
    assert shapes["door"][0][0].length == pytest.approx(0.9)
    assert {p["id"]: (g.x, g.y) for g, p in shapes["anchor"]}["022E"] == (4.0, 1.0)
    assert {p["id"]: p["status"] for _, p in shapes["anchor"]}["C"] == "mirror-ambiguous"


def test_svg_is_xml_with_y_upwards(solution):
    root = ElementTree.fromstring(only(solution, "svg"))  # noqa: S314 - our own
    name = "{http://www.w3.org/2000/svg}"
    assert root.find(f"{name}title").text == "two & <rooms>"
    circles = {
        c.get("id"): (float(c.get("cx")), float(c.get("cy"))) for c in root.iter(f"{name}circle")
    }
    assert circles["ANCHORS-B<&"] == (1.0, 2.0004)
    assert circles["STATIONS-s02"] == (3.0, -1.0)
    x, y, width, height = map(float, root.get("viewBox").split())
    assert all(x < cx < x + width and y < cy < y + height for cx, cy in circles.values())


def test_map_server_pgm(solution):
    files = EXPORTERS["ros"](solution)
    picture = np.asarray(Image.open(io.BytesIO(files["map.pgm"])))
    assert files["map.pgm"].startswith(b"P5\n6 4\n255\n")
    # The top row of the picture is the largest y: unknown, free, occupied, unknown.
    assert picture[:, 2].tolist() == [205, 254, 0, 205]
    yaml = dict(line.split(": ", 1) for line in files["map.yaml"].decode().splitlines())
    assert yaml["image"] == "map.pgm"
    assert json.loads(yaml["origin"])[:2] == [-1.0, -0.5]
    assert float(yaml["resolution"]) == 0.5


# s02 at (3, 1) looks along y: 2 m ahead is (3, 3), 1 m to its left is (2, 1).
POINTS = [[3.0, 3.0, 0.0], [2.0, 1.0, 0.0]]


@pytest.mark.parametrize("name", ["ply", "pcd"])
def test_clouds_by_open3d(solution, tmp_path, need_refiner, name):
    need_refiner("open3d")
    path = tmp_path / f"cloud.{name}"
    path.write_bytes(only(solution, name))
    # In a process of its own: the library warns while it loads.
    code = (
        "import sys, numpy, open3d; "
        "print(numpy.asarray(open3d.io.read_point_cloud(sys.argv[1]).points).tolist())"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(path)], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONWARNINGS": "ignore"},
    )  # fmt: skip
    np.testing.assert_allclose(json.loads(done.stdout.splitlines()[-1]), POINTS, atol=1e-6)


def test_g2o_by_gtsam(solution, tmp_path):
    import gtsam

    path = tmp_path / "graph.g2o"
    path.write_bytes(only(solution, "g2o"))
    graph, values = gtsam.readG2o(str(path), False)
    pose = values.atPose2(1)
    np.testing.assert_allclose(
        [pose.x(), pose.y(), pose.theta()], [3.0, 1.0, math.pi / 2], atol=1e-8
    )
    between = [
        graph.at(k)
        for k in range(graph.size())
        if isinstance(graph.at(k), gtsam.BetweenFactorPose2)
    ]
    (factor,) = between
    assert list(factor.keys()) == [0, 1]
    np.testing.assert_allclose(factor.noiseModel().covariance(), COVARIANCE, rtol=1e-6)


def test_pyfg_by_its_rule(solution):
    """Names of poses begin with any letter but L; noise is the upper triangle row by row."""
    lines = [line.split(" ") for line in only(solution, "pyfg").decode().splitlines()]
    by_kind = {}
    for kind, *rest in lines:
        by_kind.setdefault(kind, []).append(rest)
    assert [row[1] for row in by_kind["VERTEX_SE2"]] == ["A0", "A1"]
    assert [len(row) for row in by_kind["VERTEX_SE2"]] == [5, 5]
    assert by_kind["VERTEX_XY"][0] == ["L0", "4", "1"]
    (edge,) = by_kind["EDGE_SE2"]
    assert edge[1:3] == ["A0", "A1"]
    noise = np.zeros((3, 3))
    noise[np.triu_indices(3)] = [float(v) for v in edge[6:]]
    np.testing.assert_allclose(noise, np.triu(COVARIANCE))
    (link,) = by_kind["EDGE_RANGE"]
    assert link[1:3] == ["A0", "L0"]
    flat = math.sqrt(4.8**2 - 1.0)
    assert float(link[3]) == pytest.approx(flat, abs=1e-6)
    assert float(link[4]) == pytest.approx(0.01 * 4.8**2 / flat**2, rel=1e-6)
    names = list(
        csv.DictReader(io.StringIO(EXPORTERS["pyfg"](solution)["graph_names.csv"].decode()))
    )
    assert {row["pyfg"]: row["id"] for row in names} == {
        "A0": "s01", "A1": "s02", "L0": "022E", "L1": "B<&", "L2": "C",
    }  # fmt: skip


def test_tum_by_its_rule(solution):
    """time tx ty tz qx qy qz qw; half of 90 degrees has sine and cosine of sqrt(0.5)."""
    rows = [list(map(float, line.split())) for line in only(solution, "tum").decode().splitlines()]
    assert [len(row) for row in rows] == [8, 8]
    np.testing.assert_allclose(
        rows[1], [1, 3, 1, 0, 0, 0, math.sqrt(0.5), math.sqrt(0.5)], atol=1e-8
    )
    # A heading that nobody knows is no pose.
    blind = replace(solution.stations[1], heading_known=False)
    stations = (solution.stations[0], blind)
    assert len(only(replace(solution, stations=stations), "tum").splitlines()) == 1


def test_anchors_for_positioning_systems(solution):
    rows = list(csv.DictReader(io.StringIO(only(solution, "csv").decode())))
    assert rows == [
        {"anchor": "022E", "x_m": "4.0000", "y_m": "1.0000", "z_m": "2.4000"},
        {"anchor": "B<&", "x_m": "1.0000", "y_m": "-2.0004", "z_m": "2.0000"},
    ]
    entry = json.loads(only(solution, "json"))["anchors"][0]
    assert entry == {
        "id": "022E",
        "x_m": 4.0,
        "y_m": 1.0,
        "z_m": 2.4,
        "sigma_x_m": 0.1,
        "sigma_y_m": 0.1,
    }
    # Whole millimetres: -2.0004 m is -2000 mm.
    assert only(solution, "dwm1001").decode().splitlines() == [
        "022E aps 4000 1000 2400",
        "B<& aps 1000 -2000 2000",
    ]
    pozyx = json.loads(only(solution, "pozyx"))
    assert pozyx["unit"] == "mm"
    assert pozyx["anchors"][1] == {"id": "B<&", "coordinates": {"x": 1000, "y": -2000, "z": 2000}}


def test_bitcraze_numbers_its_anchors(solution):
    def parse(data):
        found, name = {}, None
        for line in data.decode().splitlines():
            text = line.split("#")[0].rstrip()
            key, _, value = text.strip().partition(":")
            if text.startswith(" "):
                found[name][key] = float(value)
            else:
                name, found[int(key)] = int(key), {}
        return found

    assert parse(only(solution, "bitcraze")) == {
        0: {"x": 4.0, "y": 1.0, "z": 2.4}, 1: {"x": 1.0, "y": -2.0004, "z": 2.0},
    }  # fmt: skip
    numbered = tuple(replace(a, id=n) for a, n in zip(solution.anchors, "7360", strict=True))
    assert sorted(parse(only(replace(solution, anchors=numbered), "bitcraze"))) == [3, 7]


def test_no_positioning_system_gets_an_anchor_that_is_not_ok(solution):
    assert left_out(solution) == ["C", "D"]
    assert sorted(ANCHOR_EXPORTERS) == ["bitcraze", "csv", "dwm1001", "json", "pozyx"]
    for name in ANCHOR_EXPORTERS:
        assert b"9.0" not in only(solution, name)
        assert b"9000" not in only(solution, name)


@pytest.mark.parametrize("name", sorted(EXPORTERS))
def test_the_same_bytes_twice_and_without_a_plan(solution, name):
    assert EXPORTERS[name](solution) == EXPORTERS[name](solution)
    assert EXPORTERS[name](replace(solution, plan=None))


def test_dxf_has_the_same_bytes_in_every_process():
    code = (
        "import hashlib\n"
        "from slam_uwb.io.exporters import dxf_plan\n"
        "from slam_uwb.model.settings import Settings\n"
        "from slam_uwb.model.solution import Solution\n"
        "empty = Solution('s', '', 'joint', Settings(), '1', 's1', *[()] * 6, *[None] * 3, {})\n"
        "print(hashlib.sha256(dxf_plan(empty)['floor.dxf']).hexdigest())"
    )
    # These seeds of the hash put the members of a small set in different orders.
    found = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
        ).stdout
        for seed in (4, 5, 6, 7)
    }  # fmt: skip
    assert len(found) == 1


@pytest.mark.parametrize("name", sorted(set(EXPORTERS) - {"ros"}))
def test_nothing_solved_gives_the_same_files_with_nothing_in_them(solution, name):
    empty = replace(
        solution, stations=(), anchors=(), links=(), matches=(), plan=None, scans={}, floor_map=None
    )
    files = EXPORTERS[name](empty)
    assert files.keys() == EXPORTERS[name](solution).keys()
    assert files.pop("graph_names.csv", b"kind,pyfg,g2o,id\n") == b"kind,pyfg,g2o,id\n"
    (content,) = files.values()
    assert number_of_things(name, content) == 0


def number_of_things(name, content):
    """How many places, lines or points a file holds, by the rule of its format."""
    if name == "dxf":
        import ezdxf

        return len(ezdxf.read(io.StringIO(content.decode())).modelspace())
    if name == "svg":
        shapes = ElementTree.fromstring(content).iter()  # noqa: S314 - our own
        return sum(item.tag.rpartition("}")[2] not in ("svg", "title", "g") for item in shapes)
    if name in ("geojson", "json", "pozyx"):
        return len(json.loads(content)["features" if name == "geojson" else "anchors"])
    if name in ("ply", "pcd"):
        count = re.search(rb"^(?:POINTS|element vertex) (\d+)$", content, re.MULTILINE)
        assert content.endswith((b"end_header\n", b"DATA binary\n")) == (count[1] == b"0")
        return int(count[1])
    lines = [line for line in content.decode().splitlines() if line != "{}"]
    return len(lines) - (name == "csv")


@pytest.mark.parametrize("name", sorted(set(EXPORTERS) - {"ros"}))
def test_what_is_solved_is_in_the_files(solution, name):
    assert number_of_things(name, only(solution, name)) > 0


def test_what_is_not_there_is_named(solution):
    with pytest.raises(SlamUwbError, match="--to shp: no such format; there are bitcraze, csv"):
        export_solution(solution, ["dxf", "shp"])
    with pytest.raises(SlamUwbError, match="no map"):
        export_solution(replace(solution, floor_map=None), ["ros"])
