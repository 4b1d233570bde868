"""What the walls do not tell is left open, however sure the refiner is."""

from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.hypotheses import describe_match
from slam_uwb.matching.slack import with_slack
from slam_uwb.model.geometry import Pose2


@pytest.fixture
def sure(view, settings):
    """Two views of some walls and their match at the truth, held to 5 mm and 0.1 degrees."""

    def match(walls, target, source):
        rng = np.random.default_rng(4)
        scans = [view(s, walls, p, rng, 0.005) for s, p in (("a", target), ("b", source))]
        found = describe_match(*scans, (target.inverse() @ source).vector, 0, settings)
        tight = np.diag([0.005, 0.005, np.radians(0.1)]) ** 2
        return replace(found, covariance=tight, degenerate=False), tuple(scans)

    return match


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.2])
def test_along_a_corridor_a_sure_match_gets_slack(sure, corridor, settings, turn):
    match, scans = sure(corridor, Pose2(0.0, 0.8, 0.3), Pose2(1.5, 1.2, turn))
    # Whatever the axis that the covariance calls the weakest: here that along the corridor.
    along = np.array([np.cos(turn), -np.sin(turn)])
    covariance = match.covariance.copy()
    covariance[:2, :2] += 1e-6 * np.outer(along, along)
    (loose,) = with_slack([replace(match, covariance=covariance)], [scans], settings)
    assert loose.degenerate
    across = np.array([-along[1], along[0]])
    assert along @ loose.covariance[:2, :2] @ along == pytest.approx(0.3**2, rel=1e-3)
    assert across @ loose.covariance[:2, :2] @ across == pytest.approx(0.005**2, rel=1e-3)
    assert loose.target_T_source == match.target_T_source


def test_where_every_step_costs_walls_a_match_stays_as_it_is(sure, room, settings):
    match, scans = sure(room, Pose2(1.5, 1.5, 0.3), Pose2(4.5, 1.6, 1.0))
    assert with_slack([match], [scans], settings)[0] is match


def test_what_is_free_already_stays_as_it_is(sure, corridor, settings):
    match, scans = sure(corridor, Pose2(0.0, 0.8, 0.3), Pose2(1.5, 1.2, 0.0))
    free = replace(match, degenerate=True)
    assert with_slack([free], [scans], settings)[0] is free
