"""Every example of the page on imports is run as it stands there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from slam_uwb.io import check_survey
from slam_uwb.io.importers import RANGE_FORMATS, SCAN_FORMATS

PAGE = (Path(__file__).parents[2] / "docs" / "importing.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))


def test_every_format_has_its_section_and_nothing_else_has():
    assert list(SECTIONS) == [*SCAN_FORMATS, *RANGE_FORMATS]
    for name in SECTIONS:
        assert f"[{name}](#{name})" in PAGE.partition("\n## ")[0]


# Metres as the example's numbers say: of its scan, and of its ranges by anchor.
EXPECTED = {
    "sweep-csv": ({"s01": [3.0, 4.0]}, {}),
    "frame-grabber": ({"s01": [1.5265, 2.0]}, {}),
    "csv": ({"s01": [2.5, 2.506]}, {}),
    # Two half circles about (1, 0.5), put together; the third stands 3 m off.
    "carmen": ({"s01": [2.0, 2.83, 2.0, 2.83, 2.0] * 2, "s02": [1.0, 1.41, 1.0, 1.41, 1.0]}, {}),
    "cloud": ({"s01": [2.0, 3.0]}, {}),
    "dwm1001-log": ({}, {"022E": [3.38, 3.39, 3.37], "9280": [5.49, 5.5]}),
    "trek1000-log": ({}, {"A0": [1.635], "A1": [1.443, 3.79], "A2": [1.298], "A3": [1.227]}),
    "ranges-csv": ({}, {"A1": [3.38, 3.4], "A2": [5.49]}),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_the_example_does_what_it_says(run, tmp_path, name):
    if name == "cloud":
        pytest.importorskip("open3d", exc_type=ImportError)
    section = SECTIONS[name]
    for file, text in re.findall(r"^`(\S+)`:\n\n```\n(.*?)^```", section, re.DOTALL | re.MULTILINE):
        (tmp_path / file).write_text(text, encoding="utf-8")
    (command,) = re.findall(r"^```sh\nslam-uwb (.*?)\n```", section, re.DOTALL | re.MULTILINE)
    done = run(*shlex.split(command), cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    survey = check_survey(tmp_path / "office").survey
    scans, ranges = EXPECTED[name]
    for station, metres in scans.items():
        (scan,) = [s.scan for s in survey.stations if s.id == station]
        found = scan.ranges[np.isfinite(scan.ranges)]
        assert sorted(found.tolist()) == pytest.approx(
            sorted(metres), abs=6e-4
        )  # Written to the millimetre.
    assert {k.anchor: k.distances.round(9).tolist() for k in survey.ranges} == ranges


def test_the_limits_are_the_code_s():
    from slam_uwb.io.files import MAX_FILE_BYTES
    from slam_uwb.io.importers.bags import MAX_SAMPLES
    from slam_uwb.io.importers.clouds import MAX_CLOUD_BYTES
    from slam_uwb.io.tables import MAX_LINE_CHARACTERS

    told = (MAX_FILE_BYTES / 1e6, MAX_LINE_CHARACTERS, MAX_CLOUD_BYTES / 1e9, MAX_SAMPLES / 1e6)
    words = "{:.0f} MB a text file|{:,} characters a line|{:.0f} GB a cloud|{:.0f} million samples a bag"
    for text in words.format(*told).split("|"):
        assert text in PAGE.replace("\n  ", " ")
