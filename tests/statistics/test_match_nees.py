"""Errors of matches against their covariances under the default settings: 360 and 720 samples, 1 and 2 cm."""

import math
from itertools import product

import numpy as np
import pytest

from slam_uwb.matching.covariance import match_covariance
from slam_uwb.matching.index import index_scan
from slam_uwb.matching.refiners.point_to_line import refine_point_to_line
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MatchingSettings, ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays

pytestmark = pytest.mark.slow

RUNS = 30  # of each of the four kinds of scan
SETTINGS = MatchingSettings()
FREE_M = 0.5  # directions of a larger standard deviation claim no knowledge; a turn at 6 m


def polygon(*corners):
    points = np.array(corners, dtype=float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


ROOMS = (
    polygon((0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)),
    polygon((0, 0), (4, 0), (4, 3), (0, 3)),
)


def draw_scene(kind, rng):
    """Walls and two poses, drawn anew each time."""
    headings = rng.uniform(-math.pi, math.pi, 2)
    if kind == "room":
        walls = ROOMS[rng.integers(len(ROOMS))]
        places = rng.uniform(0.5, 2.5, (2, 2))
    else:
        width = rng.uniform(1.5, 2.5)
        ends = [((5, 0), (5, width))] if kind == "end wall" else []
        reach = 5 if ends else 50
        walls = np.array([((-50, 0), (reach, 0)), ((-50, width), (reach, width)), *ends], float)
        places = rng.uniform((-1, 0.5), (1, width - 0.5), (2, 2)) + [[0, 0], [2, 0]]
    return walls, [Pose2(x, y, theta) for (x, y), theta in zip(places, headings, strict=True)]


def view(walls, pose, samples, noise, rng):
    bearings = (np.arange(samples) + 0.5) * (2.0 * math.pi / samples) - math.pi
    ranges = cast_rays(pose.translation, bearings + pose.theta, walls)
    ranges = ranges + rng.normal(0.0, noise, samples)
    scan = Scan(bearings, np.where(ranges <= 12.0, ranges, np.nan), 12.0)
    return index_scan(prepare_scan("s", scan, ScanSettings()), SETTINGS)


def held_error(error, covariance):
    """Squared normalised error in the directions that are claimed to be known, and how many these are."""
    units = np.diag([1.0, 1.0, 6.0])
    variances, axes = np.linalg.eigh(units @ covariance @ units)
    known = variances < FREE_M**2
    along = (axes.T @ units @ error)[known]
    return float(np.sum(along**2 / variances[known])), int(known.sum())


@pytest.fixture(scope="module", params=["room", "end wall", "corridor"])
def matches(request):
    """Of a kind of place: error, covariance, whether free, heading of the source; by samples and noise."""
    found = {}
    for samples, noise in product((360, 720), (0.01, 0.02)):
        rows = found[samples, noise] = []
        for seed in range(RUNS):
            rng = np.random.default_rng([seed, samples, round(100 * noise)])
            walls, (a, b) = draw_scene(request.param, rng)
            target, source = (view(walls, pose, samples, noise, rng) for pose in (a, b))
            truth = a.inverse() @ b
            start = truth @ Pose2(*rng.uniform([-0.1, -0.1, -0.05], [0.1, 0.1, 0.05]))
            poses = refine_point_to_line(target, source, start.vector[None], SETTINGS).poses
            pose = Pose2.from_vector(poses[0])
            covariance, free = match_covariance(target, source, pose, SETTINGS)
            rows.append(((truth.inverse() @ pose).vector, covariance, free, b.theta))
    return request.param, found


def test_squared_errors_are_half_to_twice_what_the_covariance_tells(matches):
    _, found = matches
    results = {key: [held_error(*row[:2]) for row in rows] for key, rows in found.items()}
    means = {key: np.sum(rows, axis=0) for key, rows in results.items()}
    total, freedom = np.sum(list(means.values()), axis=0)
    assert 0.5 < total / freedom < 2.0
    for key, (part, count) in means.items():
        # The mean of 30 matches is uncertain itself: 15 to 30 %.
        assert 0.35 < part / count < 2.6, key


def test_a_corridors_axis_is_free_and_nothing_else_is(matches):
    kind, found = matches
    for rows in found.values():
        assert all(free == (kind == "corridor") for _, _, free, _ in rows)
        for _, covariance, _, heading in rows:
            axis = np.array([math.cos(heading), -math.sin(heading), 0.0])
            along = math.sqrt(axis @ covariance @ axis)
            assert along > 0.9 if kind == "corridor" else along < 0.05
