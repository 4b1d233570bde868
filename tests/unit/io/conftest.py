from pathlib import Path

import pytest

SURVEY_TOML = """\
format = 1
name = "two rooms"
sequence = [["s01", "s02"]]

[lidar]
angle_direction = "ccw"
max_range_m = 25.0

[tag]
height_m = 1.4

[[stations]]
id = "s01"
scan = "scans/s01.csv"

[[stations]]
id = "s02"
scan = "scans/s02.csv"

[[anchors]]
id = "A1"
height_m = 2.4
"""
SCAN = "angle_deg,range_m\n0,1\n90,2\n180,3\n270,4\n"
FILES = {
    "survey.toml": SURVEY_TOML,
    "scans/s01.csv": SCAN,
    "scans/s02.csv": SCAN,
    "ranges.csv": "station,anchor,range_m\ns01,A1,3.25\ns01,A1,3.5\ns02,A1,4.5\n",
}


@pytest.fixture
def make_survey(tmp_path: Path):
    """A sound survey folder, with some files replaced (text or bytes), left out (None) or edited.

    A pair (old, new) edits: every `old`, which has to be there, becomes `new`.
    """

    def make(changes=None, folder="survey") -> Path:
        root = tmp_path / folder
        for name, content in (FILES | (changes or {})).items():
            if content is None:
                continue
            if isinstance(content, tuple):
                assert content[0] in FILES[name]
                content = FILES[name].replace(*content)
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return root

    return make
