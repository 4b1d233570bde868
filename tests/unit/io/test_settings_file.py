import tomllib
from pathlib import Path

import pytest

from slam_uwb.io import format_settings, read_settings
from slam_uwb.model.errors import SettingsError
from slam_uwb.model.settings import PRESETS, Settings


def write(tmp_path, text):
    path = tmp_path / "settings.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", PRESETS)
def test_presets(tmp_path, name):
    assert read_settings(name) == PRESETS[name]
    path = write(tmp_path, format_settings(PRESETS[name]))
    assert read_settings(path) == PRESETS[name]
    assert read_settings(str(path)) == PRESETS[name]


def test_text_holds_every_key_with_its_remark():
    text = format_settings(Settings())
    assert tomllib.loads(text) == Settings().model_dump()
    lines = text.splitlines()
    keys = [i for i, line in enumerate(lines) if " = " in line and not line.startswith("#")]
    assert len(keys) == sum(len(section) for section in Settings().model_dump().values())
    assert all(lines[i - 1].startswith("# ") for i in keys)
    assert max(map(len, lines)) <= 100
    above = lines[lines.index("bin_deg = 1.0") - 1]
    assert above.endswith("(degrees, > 0, <= 10)")


def test_file_says_what_differs(tmp_path):
    settings = read_settings(write(tmp_path, "[scan]\nbin_deg = 2\n"))
    assert settings.scan.bin_deg == 2.0
    assert settings.graph == Settings().graph


def test_file_named_like_a_preset_needs_a_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper").write_text("[scan]\nbin_deg = 2\n")
    assert read_settings("paper") == PRESETS["paper"]
    assert read_settings("./paper").scan.bin_deg == 2.0
    assert read_settings(Path("paper")).scan.bin_deg == 2.0


@pytest.mark.parametrize(
    ("text", "key", "problem"),
    [
        ("[scan]\nbin_dge = 2", "scan.bin_dge", "no such setting"),
        ("[scna]\n", "scna", "no such setting"),
        ("bin_deg = 2", "bin_deg", "no such setting"),
        ("[scan]\nbin_deg = 0.0", "scan.bin_deg", "greater than 0 (given: 0.0)"),
        ("[scan]\nbin_deg = 11.0", "scan.bin_deg", "less than or equal to 10 (given: 11.0)"),
        ('[scan]\nbin_deg = "2"', "scan.bin_deg", "valid number (given: '2')"),
        ("[scan]\nbin_deg = true", "scan.bin_deg", "valid number (given: True)"),
        ("[graph]\noffset_mean_m = nan", "graph.offset_mean_m", "finite number (given: nan)"),
        ('[graph]\nmode = "both"', "graph.mode", "'joint' or 'sequential' (given: 'both')"),
        ("scan = 3", "scan", "(given: 3)"),
    ],
)
def test_bad_key(tmp_path, text, key, problem):
    with pytest.raises(SettingsError) as raised:
        read_settings(write(tmp_path, text))
    assert raised.value.key == key
    assert problem in str(raised.value)
    assert raised.value.exit_status == 2


def test_every_bad_key_at_once(tmp_path):
    with pytest.raises(SettingsError, match=r"scan\.a: (.|\n)*graph\.b: "):
        read_settings(write(tmp_path, "[scan]\na = 1\n[graph]\nb = 2\n"))


def test_no_such_file():
    with pytest.raises(SettingsError, match=r"papre: no such file, and no preset \(.*paper\)"):
        read_settings("papre")


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"[scan]\nbin_deg == 2\n", "no TOML: Invalid value \\(at line 2, column 10\\)"),
        (b"\xff", "expected UTF-8 text"),
        (b"#" * 1_000_001, "larger than 1,000,000 bytes"),
    ],
    ids=["syntax", "encoding", "size"],
)
def test_no_toml(tmp_path, data, problem):
    (tmp_path / "s.toml").write_bytes(data)
    with pytest.raises(SettingsError, match=problem):
        read_settings(tmp_path / "s.toml")
