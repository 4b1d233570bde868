import math

import numpy as np
import pytest

from slam_uwb.matching.crossing import crossing
from slam_uwb.matching.evidence import single_block, total_evidence
from slam_uwb.matching.gain import merge_blocks, merge_gains


@pytest.fixture
def blocks(three_room_scans, three_room_poses, settings):
    """Two blocks of two stations, and the right pose a_T_b of the second in the first."""

    def block(m, n):
        place = (three_room_poses[m].inverse() @ three_room_poses[n]).vector
        ends = (single_block(station, three_room_scans[station]) for station in (m, n))
        return merge_blocks(*ends, place, three_room_scans, settings)

    right = three_room_poses["s3"].inverse() @ three_room_poses["s5"]
    return block("s3", "s4"), block("s5", "s6"), right.vector


@pytest.fixture
def candidates(blocks):
    """The right one, one beside it, one turned, and one where the walls deny each other."""
    off = [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1], [1.5, 1.0, 0.8]]
    return blocks[2] + np.array(off, dtype=float)


def test_a_gain_is_what_the_merged_map_has_more(blocks, candidates, three_room_scans, settings):
    a, b, _ = blocks
    gains = merge_gains(a, b, candidates, three_room_scans, settings)
    apart = sum(total_evidence(block, three_room_scans, settings) for block in (a, b))
    for pose, gain in zip(candidates, gains, strict=True):
        merged = merge_blocks(a, b, pose, three_room_scans, settings)
        together = total_evidence(merged, three_room_scans, settings)
        assert gain == pytest.approx(together - apart, abs=1e-9)
    assert np.argmax(gains) == 0
    assert gains[3] < -40.0


def test_only_candidates_that_walls_deny_are_given_up(
    blocks, candidates, three_room_scans, settings
):
    a, b, _ = blocks
    gains = merge_gains(a, b, candidates, three_room_scans, settings)
    in_short = merge_gains(a, b, candidates, three_room_scans, settings, least=-20.0)
    np.testing.assert_allclose(in_short[:3], gains[:3], atol=1e-12)
    assert in_short[3] == -math.inf


def test_where_nothing_is_in_sight_nothing_is_gained(blocks, three_room_scans, settings):
    a, b, _ = blocks
    far = np.array([[100.0, 0.0, 0.0]])
    assert not list(crossing(a, b, far, three_room_scans))
    assert merge_gains(a, b, far, three_room_scans, settings) == pytest.approx([0.0])
