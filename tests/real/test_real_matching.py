import math
from itertools import combinations

import numpy as np
import pytest

from slam_uwb.io import read_reference, read_survey
from slam_uwb.matching import index_scans, match_pairs
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import Settings
from slam_uwb.scan import prepare_scan

pytestmark = pytest.mark.real

SETTINGS = Settings()
RIGHT_M, RIGHT_RAD = 0.15, math.radians(4.0)


def overlap(a, b, a_T_b):
    """Share of the points of both scans within 0.1 m of the other, as the registration study counts it."""
    moved = a_T_b.transform(b.points)
    apart = np.linalg.norm(moved[:, None] - a.points[None], axis=2)
    near = [*(apart.min(axis=0) < 0.1), *(apart.min(axis=1) < 0.1)]
    return np.mean(near)


@pytest.fixture(scope="module")
def flat(surveys_folder):
    """Scans and reference poses of the flat, and the best hypothesis of every pair by its stations."""
    survey = read_survey(surveys_folder / "kolakowski-flat")
    reference = read_reference(surveys_folder / "kolakowski-flat").stations
    scans = {s.id: prepare_scan(s.id, s.scan, SETTINGS.scan) for s in survey.stations}
    poses = {s: Pose2(reference[s].x, reference[s].y, reference[s].theta) for s in scans}
    matches = match_pairs(
        tuple(combinations(scans, 2)), index_scans(scans, SETTINGS.matching), SETTINGS.matching
    )
    best = {(m.target, m.source): m for m in matches if m.rank == 0}
    return scans, poses, best


def right(match, poses):
    truth = poses[match.target].inverse() @ poses[match.source]
    return (
        match.target_T_source.distance_to(truth) < RIGHT_M
        and match.target_T_source.angle_to(truth) < RIGHT_RAD
    )


def test_the_best_hypothesis_of_overlapping_scans_is_right(flat):
    scans, poses, best = flat
    pairs = [
        pair for pair in combinations(scans, 2)
        if overlap(scans[pair[0]], scans[pair[1]], poses[pair[0]].inverse() @ poses[pair[1]]) > 0.3
    ]  # fmt: skip
    # The study counts 69 such pairs.
    assert len(pairs) > 50
    hits = [pair in best and right(best[pair], poses) for pair in pairs]
    wrong = [pair for pair, hit in zip(pairs, hits, strict=True) if not hit]
    assert np.mean(hits) >= 0.95, f"{len(wrong)} of {len(pairs)} wrong: {wrong}"
