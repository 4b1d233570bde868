"""Every export of a real survey and of a simulated one is opened by its own reader."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from shapely.geometry import shape

from slam_uwb import read_survey, solve_survey
from slam_uwb.io.exporters import EXPORTERS, export_solution

DATASETS = Path(__file__).parents[2] / "datasets"


@pytest.fixture(scope="module", params=["kolakowski-flat", "paper-office"])
def exported(request, tmp_path_factory):
    """A survey solved and written in all formats."""
    real = request.param == "kolakowski-flat"
    folder = request.getfixturevalue("surveys_folder") if real else DATASETS
    solution = solve_survey(read_survey(folder / request.param))
    target = tmp_path_factory.mktemp("export")
    for name, data in export_solution(solution, list(EXPORTERS)).items():
        (target / name).write_bytes(data)
    return solution, target


pytestmark = pytest.mark.real


def test_plans(exported):
    import ezdxf

    solution, folder = exported
    document = ezdxf.readfile(folder / "floor.dxf")
    auditor = document.audit()
    assert (auditor.errors, auditor.fixes) == ([], [])
    placed = [a for a in solution.anchors if a.position is not None]
    assert len(document.modelspace().query('CIRCLE[layer=="ANCHORS"]')) == len(placed)
    features = json.loads((folder / "floor.geojson").read_text())["features"]
    assert len(features) > len(placed)
    assert all(shape(feature["geometry"]).is_valid for feature in features)
    root = ElementTree.parse(folder / "floor.svg").getroot()  # noqa: S314 - our own
    assert root.tag.endswith("svg")
    picture = np.asarray(Image.open(folder / "map.pgm"))
    assert picture.shape == solution.floor_map.occupancy.shape


def test_graphs(exported):
    import gtsam

    solution, folder = exported
    placed = [s for s in solution.stations if s.pose is not None]
    graph, values = gtsam.readG2o(str(folder / "graph.g2o"), False)
    used = sum(match.rejection is None for match in solution.matches)
    factors = [graph.at(k) for k in range(graph.size())]
    assert sum(isinstance(f, gtsam.BetweenFactorPose2) for f in factors) == used
    assert sum(values.exists(k) for k in range(len(solution.stations))) <= len(placed)
    lines = [line.split() for line in (folder / "graph.pyfg").read_text().splitlines()]
    lengths = {"VERTEX_SE2": 6, "VERTEX_XY": 4, "EDGE_SE2": 13, "EDGE_RANGE": 6}
    assert {line[0] for line in lines} == lengths.keys()
    assert all(len(line) == lengths[line[0]] for line in lines)
    poses = [
        list(map(float, row.split())) for row in (folder / "stations.tum").read_text().splitlines()
    ]
    assert {len(row) for row in poses} == {8}
    np.testing.assert_allclose(np.linalg.norm(np.array(poses)[:, 4:], axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize("name", ["cloud.ply", "cloud.pcd"])
def test_clouds(exported, need_refiner, name):
    need_refiner("open3d")
    _, folder = exported
    code = "import sys, open3d; print(len(open3d.io.read_point_cloud(sys.argv[1]).points))"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(folder / name)],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONWARNINGS": "ignore"},
    )  # fmt: skip
    assert int(done.stdout.split()[-1]) > 1000


def test_anchors(exported):
    solution, folder = exported
    sure = [a for a in solution.anchors if a.status == "ok"]
    rows = list(csv.DictReader(io.StringIO((folder / "anchors_xyz.csv").read_text())))
    assert [row["anchor"] for row in rows] == [a.id for a in sure]
    entries = json.loads((folder / "anchors_xyz.json").read_text())["anchors"]
    for anchor, row, entry in zip(sure, rows, entries, strict=True):
        np.testing.assert_allclose(
            [float(row["x_m"]), float(row["y_m"])], anchor.position, atol=5.1e-5
        )
        np.testing.assert_allclose([entry["x_m"], entry["y_m"]], anchor.position, atol=5.1e-5)
    lines = [line.split() for line in (folder / "anchors_dwm1001.txt").read_text().splitlines()]
    assert [line[:2] for line in lines] == [[a.id, "aps"] for a in sure]
    assert all(int(v) == round(1000 * w) for line, a in zip(lines, sure, strict=True)
               for v, w in zip(line[2:4], a.position, strict=True))  # fmt: skip
    pozyx = json.loads((folder / "anchors_pozyx.json").read_text())
    assert len(pozyx["anchors"]) == len(sure)
    # `number: ` lines with x, y and z below each.
    bitcraze = (folder / "anchors_bitcraze.yaml").read_text().splitlines()
    assert sum(line.strip().startswith("x:") for line in bitcraze) == len(sure)
