"""``slam-uwb settings``."""

import tomllib

import pytest

from slam_uwb.model.settings import PRESETS, settings_from_mapping


@pytest.mark.parametrize("preset", PRESETS)
def test_prints_the_preset_as_toml_that_reads_back(run, preset):
    done = run("settings", preset)
    assert done.returncode == 0
    assert settings_from_mapping(tomllib.loads(done.stdout)) == PRESETS[preset]


def test_default_is_default(run):
    assert run("settings").stdout == run("settings", "default").stdout


def test_every_setting_has_its_reason(run):
    text = run("settings").stdout
    for section in type(PRESETS["default"]).model_fields.values():
        for name, field in section.annotation.model_fields.items():
            assert name in text
            # Comments may be wrapped.
            assert field.description.split()[0] in text


def test_unknown_preset_ends_with_2_and_lists_the_known(run):
    done = run("settings", "magic")
    assert done.returncode == 2
    assert done.stdout == ""
    assert "magic" in done.stderr
    assert "default, paper" in done.stderr
