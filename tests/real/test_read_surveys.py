import numpy as np
import pytest

from slam_uwb.io import check_survey, read_reference

pytestmark = pytest.mark.real

# (stations, scans, anchors, links): counted in the survey.toml and ranges.csv of each.
SURVEYS = {
    "kolakowski-flat": (21, 21, 6, 118),
    "tau-lab446a": (5, 5, 0, 0),
    "lias-hall": (90, 0, 8, 720),
}


@pytest.mark.parametrize("name", SURVEYS)
def test_reads_without_fault(surveys_folder, name):
    check = check_survey(surveys_folder / name)
    assert check.faults == ()
    assert check.warnings == ()
    survey = check.survey
    scans = [station.scan for station in survey.stations if station.scan is not None]
    counts = (len(survey.stations), len(scans), len(survey.anchors), len(survey.ranges))
    assert counts == SURVEYS[name]
    for scan in scans:
        assert np.isfinite(scan.ranges).any()
        assert np.nanmax(scan.ranges) <= scan.max_range


@pytest.mark.parametrize("name", SURVEYS)
def test_reference_speaks_of_the_survey(surveys_folder, name):
    survey = check_survey(surveys_folder / name).survey
    reference = read_reference(surveys_folder / name)
    assert reference.anchors.keys() <= {anchor.id for anchor in survey.anchors}
    assert reference.stations.keys() <= {station.id for station in survey.stations}
    assert len(reference.anchors) + len(reference.stations) > 0
