"""A station that fits at two places: what the solution folder says of it."""

import csv
import math

import numpy as np
import pytest

from slam_uwb.io import write_survey
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import Scan, Station, Survey
from slam_uwb.simulate.segments import cast_rays

# A hall with an alcove in its north wall and a second one like it 4 m to the east. Of the second the
# other stations see more, so that there a scan confirms less that is new: 7 m of wall, not 9.5.
ALCOVES_APART = 4.0
HALL = [
    (0, 0), (9, 0), (9, 2.2), (8.1, 2.2), (8.1, 3.5),
    (6.6, 3.5), (6.6, 5.3), (5.0, 5.3), (5.0, 3.5), (2.6, 3.5), (2.6, 5.3), (1.0, 5.3), (1.0, 3.5), (0, 3.5),
]  # fmt: skip
PILLAR = [(3.2, 1.0), (3.7, 1.0), (3.7, 1.3), (3.2, 1.3)]
POSES = {
    "h1": Pose2(1.7, 2.0, 0.4), "h2": Pose2(4.2, 2.9, -1.2), "h3": Pose2(5.8, 2.4, 2.0),
    "h4": Pose2(8.4, 0.6, -2.5), "y": Pose2(1.9, 4.4, 0.7),
}  # fmt: skip


def ring(corners):
    corners = np.array(corners, dtype=float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def record(name, rng):
    """One revolution; the station in the alcove sees no further than the alcove."""
    pose, walls = POSES[name], np.concatenate([ring(HALL), ring(PILLAR)])
    bearings = np.radians(np.arange(-180, 180) + 0.5)
    ranges = cast_rays(pose.translation, bearings + pose.theta, walls) + rng.normal(0, 0.005, 360)
    points = ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    outside = (name == "y") & (pose.transform(points)[:, 1] < 3.5)
    return Scan(bearings, np.where(outside, np.nan, ranges), 40.0)


@pytest.fixture(scope="module")
def solution(run, tmp_path_factory):
    rng = np.random.default_rng(1)
    stations = tuple(Station(name, record(name, rng), math.nan) for name in POSES)
    folder = tmp_path_factory.mktemp("alcoves")
    write_survey(Survey("alcoves", stations, ()), folder / "survey")
    done = run("solve", folder / "survey", "--out", folder / "out")
    assert done.returncode == 0, done.stderr
    return folder / "out"


def rows(folder, name):
    with (folder / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_its_place_is_empty_and_its_status_says_why(solution):
    stations = {row["station"]: row for row in rows(solution, "stations.csv")}
    assert {name: row["status"] for name, row in stations.items()} == {
        **dict.fromkeys(("h1", "h2", "h3", "h4"), "ok"),
        "y": "ambiguous",
    }
    assert stations["y"]["x_m"] == stations["y"]["y_m"] == stations["y"]["yaw_deg"] == ""


def test_both_places_are_listed_with_their_weights(solution):
    places = rows(solution, "alternatives.csv")
    assert [(row["kind"], row["id"]) for row in places] == [("station", "y")] * 2
    weights = [float(row["weight"]) for row in places]
    assert weights == sorted(weights, reverse=True)
    assert sum(weights) == pytest.approx(1.0, abs=0.01)
    # In the frame of the first station, the better place first: here the right one.
    first = POSES["h1"].inverse()
    other = Pose2(POSES["y"].x + ALCOVES_APART, POSES["y"].y, POSES["y"].theta)
    for row, place in zip(places, (POSES["y"], other), strict=True):
        found = Pose2(float(row["x_m"]), float(row["y_m"]), math.radians(float(row["yaw_deg"])))
        assert found.distance_to(first @ place) < 0.1
        assert found.angle_to(first @ place) < math.radians(3.0)


def test_none_of_its_matches_is_used(solution):
    matches = [r for r in rows(solution, "matches.csv") if "y" in (r["station_m"], r["station_n"])]
    assert matches
    for row in matches:
        assert row["used"] == "false"
        assert row["reason"]
