import math

import pytest

from slam_uwb.io import read_reference
from slam_uwb.model.errors import SurveyFormatError
from slam_uwb.model.survey import ReferencePlace


def write(folder, **files):
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def faults(folder):
    with pytest.raises(SurveyFormatError) as raised:
        read_reference(folder)
    return [str(fault) for fault in raised.value.faults]


def test_empty_cells_are_not_known(tmp_path):
    stations = "station,x_m,y_m,yaw_deg\ns01,1,2,-180\ns02,3,4,\ns03,,,\n"
    reference = read_reference(write(tmp_path, stations=stations))
    assert reference.anchors == {}
    assert reference.stations["s01"] == ReferencePlace(1.0, 2.0, math.pi)
    assert math.isnan(reference.stations["s02"].theta)
    assert math.isnan(reference.stations["s03"].x)


def test_further_columns_and_files_are_left_alone(tmp_path):
    folder = write(tmp_path, anchors="anchor,note,x_m,y_m\nA1,high,1,2\n", layout="nonsense")
    assert read_reference(folder).anchors["A1"].y == 2.0


def test_every_fault_at_once(tmp_path):
    folder = write(
        tmp_path,
        anchors="anchor,x_m,y_m\nA1,one,2\nA1,1,inf\n",
        stations="station,x_m\ns01,1\n",
    )
    assert faults(folder) == [
        'anchors.csv:2: x_m: "one": expected a number',
        'anchors.csv:3: anchor: "A1" is there twice',
        "anchors.csv:3: inf: expected a finite number or nothing",
        'stations.csv:1: y_m: missing: the header is "station,x_m", expected station,x_m,y_m',
    ]


def test_nothing_there(tmp_path):
    assert faults(tmp_path / "none") == [f"{tmp_path / 'none'}: no such folder"]
    expected = f"{tmp_path}: neither anchors.csv nor stations.csv: expected a reference"
    assert faults(tmp_path) == [expected]
