"""A flat whose last station came later."""

from dataclasses import replace

import pytest

from slam_uwb import simulate_survey, solve_survey
from slam_uwb.model.survey import Survey
from slam_uwb.simulate import Lidar


def first_stations(survey: Survey, count: int) -> Survey:
    """The survey as it was when only its first stations had been recorded."""
    stations = survey.stations[:count]
    names = {station.id for station in stations}
    return replace(
        survey,
        stations=stations,
        ranges=tuple(item for item in survey.ranges if item.station in names),
        sequence=None,
        checksum="",
    )


@pytest.fixture(scope="session")
def flat():
    """Six stations with their truth."""
    simulation = simulate_survey("flat", 1, lidar=Lidar(duration=10.0, upper_duration=0.0))
    return replace(simulation, survey=first_stations(simulation.survey, 6))


@pytest.fixture(scope="session")
def earlier(flat):
    """Its first five stations, solved."""
    return solve_survey(first_stations(flat.survey, 5))


@pytest.fixture(scope="session")
def matched():
    """How many pairs each kind of work had, filled by the solution below."""
    return {}


@pytest.fixture(scope="session")
def continued(flat, earlier, matched):
    """The sixth station added."""
    return solve_survey(
        flat.survey, earlier=earlier, progress=lambda what, _, total: matched.update({what: total})
    )
