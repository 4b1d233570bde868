import math

import pytest
from pydantic import BaseModel, ValidationError

from slam_uwb.model.errors import SettingsError
from slam_uwb.model.settings import PRESETS, Settings, settings_from_mapping

SECTIONS = tuple(Settings.model_fields)
NUMBERS = [
    (section, name)
    for section in SECTIONS
    for name, field in type(getattr(Settings(), section)).model_fields.items()
    if field.annotation in (int, float)
]


def value_of(section, name):
    return getattr(getattr(Settings(), section), name)


def limits(section, name):
    field = type(getattr(Settings(), section)).model_fields[name]
    return {kind: getattr(item, kind) for item in field.metadata for kind in ("gt", "ge", "lt", "le")
            if getattr(item, kind, None) is not None}  # fmt: skip


def test_nothing_given_gives_the_defaults():
    assert settings_from_mapping({}) == Settings() == PRESETS["default"]


def test_what_is_given_replaces_one_default_only():
    settings = settings_from_mapping({"scan": {"bin_deg": 2.0}})
    assert settings.scan.bin_deg == 2.0
    assert settings.scan.model_copy(update={"bin_deg": 1.0}) == Settings().scan
    assert settings.matching == Settings().matching


def test_unknown_sections_are_refused():
    with pytest.raises(SettingsError, match=r"settings: maping: no such setting"):
        settings_from_mapping({"maping": {}})


@pytest.mark.parametrize("section", SECTIONS)
def test_unknown_keys_are_refused_in_every_section(section):
    with pytest.raises(SettingsError, match=rf"settings: {section}\.no_such: no such") as caught:
        settings_from_mapping({section: {"no_such": 1}})
    assert caught.value.key == f"{section}.no_such"
    assert caught.value.exit_status == 2


def test_every_fault_is_named_with_its_value():
    with pytest.raises(SettingsError) as caught:
        settings_from_mapping({"scan": {"bin_deg": -1.0}, "matching": {"pairs": "some"}, "x": 1})
    message = str(caught.value)
    for part in ("scan.bin_deg", "-1.0", "matching.pairs", "'some'", "settings: x:"):
        assert part in message


@pytest.mark.parametrize(("section", "name"), NUMBERS)
@pytest.mark.parametrize("value", ["0.1", True, math.nan, math.inf, None, [1]])
def test_only_finite_numbers_pass_for_numbers(section, name, value):
    with pytest.raises(SettingsError, match=rf"{section}\.{name}"):
        settings_from_mapping({section: {name: value}})


@pytest.mark.parametrize(
    ("section", "name"), [item for item in NUMBERS if limits(*item)], ids=lambda item: item
)
def test_limits_hold_and_are_no_tighter_than_said(section, name):
    step = type(value_of(section, name))(1)
    for kind, limit in limits(section, name).items():
        at, out = type(step)(limit), limit - step if kind[0] == "g" else limit + step
        with pytest.raises(SettingsError):
            settings_from_mapping({section: {name: out}})
        if kind[1] == "e":
            settings_from_mapping({section: {name: at}})
        else:
            with pytest.raises(SettingsError):
                settings_from_mapping({section: {name: at}})


def test_lengths_cannot_be_negative():
    """A distance below zero is never meant; means and log-odds may be."""
    signed = {"min_evidence_m", "offset_mean_m"}
    for section, name in NUMBERS:
        if name.endswith(("_m", "_deg")) and name not in signed:
            with pytest.raises(SettingsError):
                settings_from_mapping({section: {name: -1e-9}})


def test_whole_numbers_pass_for_floats_but_not_the_other_way():
    assert settings_from_mapping({"scan": {"bin_deg": 2}}).scan.bin_deg == 2.0
    with pytest.raises(SettingsError, match=r"matching\.hypotheses"):
        settings_from_mapping({"matching": {"hypotheses": 2.5}})


def test_settings_do_not_change():
    with pytest.raises(ValidationError, match="frozen"):
        Settings().scan.bin_deg = 2.0


@pytest.mark.parametrize("name", PRESETS)
def test_presets_survive_their_own_text(name):
    preset = PRESETS[name]
    assert settings_from_mapping(preset.model_dump()) == preset
    assert settings_from_mapping(preset.model_dump(exclude_defaults=True)) == preset


def test_the_preset_of_the_paper_is_what_the_paper_prints():
    # III.A: walls over 0.3 m, sides within 0.1 m, d_max 0.4 m, five initial matches; eq. 2.
    paper = PRESETS["paper"]
    assert paper.scan.min_segment_length_m == 0.3
    assert paper.matching.landmark_side_m == 0.1
    assert paper.matching.closest_point_m == 0.4
    assert paper.matching.initial_matches == 5
    assert (paper.matching.initialiser, paper.matching.refiner) == ("landmark", "paper_lm")
    assert paper.matching.ranking == "closest_points"
    assert paper.ranging.two_way == "symmetric"


def test_every_setting_says_why():
    for section in SECTIONS:
        part = getattr(Settings(), section)
        assert isinstance(part, BaseModel)
        for name, field in type(part).model_fields.items():
            assert field.description, f"{section}.{name}"
