import numpy as np
import pytest

from slam_uwb.io import check_survey

TOML = "survey.toml"
RANGES = "station,anchor,range_m\n"


def the_warning(folder):
    check = check_survey(folder)
    assert check.faults == ()
    assert len(check.warnings) == 1, "\n".join(map(str, check.warnings))
    return str(check.warnings[0])


def test_a_sound_survey_has_none(make_survey):
    check = check_survey(make_survey())
    assert check.faults == check.warnings == ()


@pytest.mark.parametrize(
    ("value", "shown"),
    [("-0.5", "-0.5"), ("", "nan"), ("nan", "nan"), ("inf", "inf"), ("1000.5", "1000.5")],
)
def test_absurd_range_is_kept(make_survey, value, shown):
    folder = make_survey({"ranges.csv": f"{RANGES}s01,A1,3\ns01,A1,{value}\n"})
    expected = f"ranges.csv:3: range_m: {shown}: expected 0 to 1000 m; kept, not used"
    assert the_warning(folder) == expected
    distances = check_survey(folder).survey.ranges[0].distances
    np.testing.assert_array_equal(distances, [3.0, float(value or "nan")])


def test_absurd_period_is_kept(make_survey):
    twr = "station,anchor,t1_s,t2_s,t3_s,t4_s\ns01,A1,1e-3,-1e-3,1e-3,1e-3\n"
    folder = make_survey({"twr.csv": twr})
    assert (
        the_warning(folder) == "twr.csv:2: t2_s: -0.001: expected a positive period; kept, not used"
    )
    assert check_survey(folder).survey.periods[0].periods[0, 1] == -1e-3


def test_anchor_heard_but_not_listed(make_survey):
    folder = make_survey({"ranges.csv": f"{RANGES}s01,A1,3\ns01,B7,3\ns02,B7,4\n"})
    expected = '"B7" is heard but not listed in survey.toml: its 2 rows are ignored'
    assert the_warning(folder) == f"ranges.csv:3: anchor: {expected}"
    assert [link.anchor for link in check_survey(folder).survey.ranges] == ["A1"]


def test_anchor_higher_than_every_range(make_survey):
    # Tag at 1.4 m, anchor at 8 m: 6.6 m apart at least, yet the longest range is 4.5 m.
    warning = the_warning(make_survey({TOML: ("height_m = 2.4", "height_m = 8")}))
    assert warning == (
        f"{TOML}:22: anchors[0].height_m = 8: every range to it is shorter than its height above "
        "the tag (longest 4.500 m)"
    )
    # At 5 m it is 3.6 m: the range of 4.5 m is possible.
    folder = make_survey({TOML: ("height_m = 2.4", "height_m = 5")}, "possible")
    assert check_survey(folder).warnings == ()


def test_incomplete_recording(make_survey):
    folder = make_survey({TOML: ('id = "s02"', 'id = "s02"\ncomplete = false')})
    expected = "stations[1].complete = false: the recording broke off; it is used as it is"
    assert the_warning(folder) == f"{TOML}:18: {expected}"
    assert [s.complete for s in check_survey(folder).survey.stations] == [True, False]


def test_unknown_key_and_column(make_survey):
    folder = make_survey({TOML: ("max_range_m", "max_rnage_m")})
    assert the_warning(folder) == f"{TOML}:7: lidar.max_rnage_m: unknown key is ignored"
    folder = make_survey({"ranges.csv": "station,anchor,range_m,battery\ns01,A1,3,low\n"}, "column")
    assert the_warning(folder) == 'ranges.csv:1: unknown column "battery" is ignored'


def test_keys_of_the_user_pass(make_survey):
    assert not check_survey(make_survey({TOML: ('id = "A1"', 'id = "A1"\nx_serial = 7')})).warnings
    # x_m is ours: a scanner has no place.
    folder = make_survey({TOML: ("[lidar]", "[lidar]\nx_m = 1")}, "place")
    assert the_warning(folder) == f"{TOML}:6: lidar.x_m: unknown key is ignored"


def test_distant_stations(make_survey):
    def placed(x):
        text = (make_survey(folder=f"text{x}") / TOML).read_text()
        text = text.replace('id = "s01"', 'id = "s01"\nx_m = 0\ny_m = 0')
        text = text.replace('id = "s02"', f'id = "s02"\nx_m = {x}\ny_m = 0')
        return check_survey(make_survey({TOML: text}, f"placed{x}")).warnings

    assert placed(2.9) == ()
    assert [w.line for w in placed(3.5)] == [12, 18]
    assert "stations[0]: station s01 is 3.50 m from the nearest other one" in str(placed(3.5)[0])


def test_a_station_of_unknown_place_may_be_near(make_survey):
    text = (make_survey(folder="text") / TOML).read_text()
    text = text.replace('id = "s01"', 'id = "s01"\nx_m = 0\ny_m = 0')
    text = text.replace('id = "s02"', 'id = "s02"\nx_m = 5\ny_m = 0')
    third = '[[stations]]\nid = "s03"\nscan = "scans/s03.csv"\n\n[[anchors]]'
    changes = {
        TOML: text.replace("[[anchors]]", third),
        "scans/s03.csv": "angle_deg,range_m\n0,1\n",
    }
    assert check_survey(make_survey(changes)).warnings == ()


def test_recording_used_twice(make_survey):
    folder = make_survey({TOML: ("scans/s02.csv", "scans/s01.csv")})
    expected = "stations[1].scan: scans/s01.csv is also the scan of station s01"
    assert the_warning(folder) == f"{TOML}:18: {expected}"


def test_angles_in_radians(make_survey):
    rows = "".join(f"{angle:.4f},2\n" for angle in np.linspace(-3.1, 3.1, 50))
    warning = the_warning(make_survey({"scans/s01.csv": "angle_deg,range_m\n" + rows}))
    assert warning == "scans/s01.csv: the angles span 6.20 degrees in all: are they radians?"


def test_station_that_nothing_locates(make_survey):
    folder = make_survey({TOML: ("[[anchors]]", '[[stations]]\nid = "s03"\n\n[[anchors]]')})
    expected = "stations[2]: neither scan nor ranges nor a known place: nothing locates it"
    assert the_warning(folder) == f"{TOML}:20: {expected}"


def test_thousands_are_counted(make_survey):
    folder = make_survey({"ranges.csv": RANGES + "s01,A1,-1\n" * 1000})
    warnings = check_survey(folder).warnings
    assert len(warnings) == 21
    assert str(warnings[-1]) == "ranges.csv: range_m: 980 more of these"


def test_survey_without_a_name(make_survey):
    folder = make_survey({TOML: ('name = "two rooms"\n', "")})
    assert the_warning(folder) == f'{TOML}: name is missing: the folder\'s, "survey", is taken'
    assert check_survey(folder).survey.name == "survey"
