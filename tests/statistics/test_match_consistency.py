"""Errors of scan matches against the covariances told with them, over many noisy recordings."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from slam_uwb.matching.covariance import match_covariance
from slam_uwb.matching.index import index_scan
from slam_uwb.matching.refiners.point_to_line import refine_point_to_line
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MatchingSettings, ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays

pytestmark = pytest.mark.slow

RUNS = 300
# Without the floor for tilt, people and glass, none of which is simulated here.
SETTINGS = MatchingSettings(sigma_floor_m=0.0, sigma_floor_deg=0.0)
CORNERS = np.array([(0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)], dtype=float)
ROOM = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)
CORRIDOR = np.array([[(-50, 0), (50, 0)], [(-50, 2), (50, 2)]], dtype=float)
CLOSED = np.array([[(-50, 0), (5, 0)], [(-50, 2), (5, 2)], [(5, 0), (5, 2)]], dtype=float)
SCENES = {
    "room": (ROOM, Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0), False),
    "corridor": (CORRIDOR, Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0), True),
    "corridor with an end": (CLOSED, Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0), False),
}


def view(walls, pose, noise, rng):
    bearings = np.radians(np.arange(-180, 180) + 0.5)
    ranges = cast_rays(pose.translation, bearings + pose.theta, walls) + rng.normal(0, noise, 360)
    scan = Scan(bearings, np.where(ranges <= 12.0, ranges, np.nan), 12.0)
    return index_scan(prepare_scan("s", scan, ScanSettings()), SETTINGS)


def run(scene, noise, seed):
    """Normalised squared error (3 degrees of freedom) and whether a direction was said to be free."""
    walls, a, b, _ = SCENES[scene]
    rng = np.random.default_rng(seed)
    target, source = view(walls, a, noise, rng), view(walls, b, noise, rng)
    truth = a.inverse() @ b
    start = truth @ Pose2(*rng.uniform([-0.1, -0.1, -0.05], [0.1, 0.1, 0.05]))
    poses = refine_point_to_line(target, source, start.vector[None], SETTINGS).poses
    pose = Pose2.from_vector(poses[0])
    covariance, degenerate = match_covariance(target, source, pose, SETTINGS)
    error = (truth.inverse() @ pose).vector
    return error @ np.linalg.solve(covariance, error), degenerate


@pytest.mark.parametrize("noise", [0.005, 0.01, 0.02])
@pytest.mark.parametrize("scene", SCENES)
def test_errors_are_inside_what_the_covariance_tells(scene, noise):
    results = [run(scene, noise, seed) for seed in range(RUNS)]
    nees = np.array([value for value, _ in results])
    # Not overconfident: the sum of RUNS x 3 squared unit normals stays below its 99.9 % bound, half as
    # much again for what a Hessian at the estimate cannot know; and not so wide as to say nothing.
    assert nees.sum() < 1.5 * chi2.ppf(0.999, 3 * RUNS)
    assert np.median(nees) > 0.1 * chi2.median(3)
    assert (nees > chi2.ppf(0.999, 3)).mean() < 0.02
    flagged = np.mean([degenerate for _, degenerate in results])
    assert flagged > 0.95 if SCENES[scene][3] else flagged < 0.02


def test_headings_of_rooms_are_right_to_hundredths_of_a_degree():
    """Averages over recordings show no bias: the error of the mean is that of chance."""
    walls, a, b, _ = SCENES["room"]
    truth, errors = a.inverse() @ b, []
    for seed in range(RUNS):
        rng = np.random.default_rng(1000 + seed)
        target, source = view(walls, a, 0.01, rng), view(walls, b, 0.01, rng)
        poses = refine_point_to_line(target, source, truth.vector[None], SETTINGS).poses
        errors.append((truth.inverse() @ Pose2.from_vector(poses[0])).vector)
    mean = np.abs(np.mean(errors, axis=0))
    assert mean[:2].max() < 0.001
    assert mean[2] < math.radians(0.03)
