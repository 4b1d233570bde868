"""The quick checksum is that of the whole reader."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.io import read_survey, survey_checksum, write_survey
from slam_uwb.model.errors import SurveyFormatError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import Decision
from slam_uwb.simulate import Lidar, simulate_survey


@pytest.fixture
def survey(tmp_path):
    made = simulate_survey("paper-office", 1, lidar=Lidar(duration=0.5, upper_duration=0.5)).survey
    decision = Decision("pair", made.stations[0].id, made.stations[1].id, "guess", Pose2(1, 0, 0))
    write_survey(replace(made, decisions=(decision,)), tmp_path / "survey")
    return tmp_path / "survey"


def test_it_is_that_of_the_survey(survey):
    assert survey_checksum(survey) == read_survey(survey).checksum


def test_every_file_that_is_used_counts_and_no_other(survey):
    before = survey_checksum(survey)
    (survey / "notes.txt").write_text("windows open")
    assert survey_checksum(survey) == before
    used = [path for path in survey.rglob("*") if path.is_file() and path.name != "notes.txt"]
    used = [path for path in used if "reference" not in path.parts]
    assert len(used) > 20
    for path in used:
        kept = path.read_bytes()
        raw = gzip.decompress(kept) if path.suffix == ".gz" else kept
        changed = raw + b"\n"
        path.write_bytes(gzip.compress(changed) if path.suffix == ".gz" else changed)
        assert survey_checksum(survey) != before, path
        path.write_bytes(kept)
    assert survey_checksum(survey) == before


def test_what_is_missing_is_named(survey):
    scan = next((survey / "scans").iterdir())
    scan.unlink()
    with pytest.raises(SurveyFormatError, match=scan.name.removesuffix(".gz")):
        survey_checksum(survey)
    (survey / "survey.toml").write_bytes(np.arange(256, dtype=np.uint8).tobytes())
    with pytest.raises(SurveyFormatError, match=r"survey\.toml"):
        survey_checksum(survey)
