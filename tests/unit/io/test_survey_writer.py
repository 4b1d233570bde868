import gzip
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slam_uwb.io import check_survey, read_reference, read_survey, write_survey
from slam_uwb.io.degrees import radians_from_degrees
from slam_uwb.model.errors import SlamUwbError
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import (
    Anchor,
    AnchorRangeSamples,
    Decision,
    KnownPlace,
    RangeOffset,
    RangeSamples,
    Reference,
    ReferencePlace,
    Scan,
    Station,
    Survey,
    TwoWayPeriods,
)


def assert_same(a: Survey, b: Survey, tolerance: float = 0.0) -> None:
    """Every field of two surveys but the checksum; arrays within `tolerance`."""
    assert plain(a) == plain(b)
    for x, y in zip(arrays(a), arrays(b), strict=True):
        np.testing.assert_allclose(x, y, rtol=0.0, atol=tolerance)


def plain(survey):
    return (
        survey.name,
        survey.anchors,
        survey.sequence,
        survey.tag_offset,
        survey.range_offset,
        [(d.kind, d.a, d.b, d.verdict, d.guess is None) for d in survey.decisions],
        [
            (s.id, repr(s.tag_height), s.known, s.upper_scan_height, s.complete)
            for s in survey.stations
        ],
        [(s.scan is None, s.upper_scan is None) for s in survey.stations],
        [(r.station, r.anchor) for r in (*survey.ranges, *survey.periods)],
        [(r.anchor_a, r.anchor_b) for r in survey.anchor_ranges],
    )


def arrays(survey):
    for station in survey.stations:
        for scan in (station.scan, station.upper_scan):
            if scan is not None:
                yield scan.bearings
                yield scan.ranges
                yield np.array([scan.max_range])
    yield from (link.distances for link in survey.ranges)
    yield from (link.periods for link in survey.periods)
    yield from (link.distances for link in survey.anchor_ranges)
    yield from (d.guess.vector for d in survey.decisions if d.guess is not None)


metres = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 30.0)
angle = st.floats(-179.9, 180.0).map(lambda d: float(radians_from_degrees(d)))
identifiers = st.text("aZ09_.-", min_size=1, max_size=5)
absurd = st.one_of(positive, st.sampled_from([-1.0, 0.0, np.nan, np.inf, 2000.0]))


@st.composite
def scans(draw):
    count = draw(st.integers(1, 4))
    ranges = draw(st.lists(st.one_of(positive, st.just(np.nan)), min_size=count, max_size=count))
    ranges[0] = 1.0
    bearings = draw(st.lists(angle, min_size=count, max_size=count))
    return Scan(np.array(bearings), np.array(ranges), 40.0)


@st.composite
def places(draw, heading):
    place = KnownPlace(draw(metres), draw(metres), draw(positive))
    if not heading:
        return place
    sigma = float(radians_from_degrees(draw(st.floats(0.1, 90.0))))
    return replace(place, theta=draw(angle), sigma_theta=sigma)


@st.composite
def surveys(draw):
    names = draw(st.lists(identifiers, min_size=1, max_size=3, unique_by=str.lower))
    stations = [
        Station(
            id=name,
            scan=(scan := draw(st.none() | scans())),
            tag_height=draw(st.sampled_from([1.25, 1.5])),
            known=draw(st.none() | places(heading=True)),
            upper_scan=None if scan is None else draw(st.none() | scans()),
            upper_scan_height=draw(st.none() | st.just(2.5)),
            complete=draw(st.booleans()),
        )
        for name in names
    ]
    anchors = [
        Anchor(
            name, draw(st.none() | st.floats(0.0, 10.0)), draw(st.none() | places(heading=False))
        )
        for name in draw(st.lists(identifiers, max_size=2, unique=True))
    ]
    links = [(s, a.id) for s in names for a in anchors]
    distances = st.lists(absurd, min_size=1, max_size=3).map(np.array)
    exchanges = st.lists(st.tuples(*[positive] * 4), min_size=1, max_size=2).map(np.array)
    kinds = [draw(st.sampled_from(["ranges", "periods", "none"])) for _ in links]
    pairs = [(m, n) for m in names for n in names if m < n]
    guesses = st.builds(Pose2, metres, metres, angle)
    return Survey(
        name=draw(st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=9)),
        stations=tuple(stations),
        anchors=tuple(anchors),
        ranges=tuple(
            RangeSamples(*link, draw(distances))
            for link, kind in zip(links, kinds, strict=True)
            if kind == "ranges"
        ),
        periods=tuple(
            TwoWayPeriods(*link, draw(exchanges) * 1e-3)
            for link, kind in zip(links, kinds, strict=True)
            if kind == "periods"
        ),
        anchor_ranges=(
            (AnchorRangeSamples(anchors[1].id, anchors[0].id, draw(distances)),)
            if len(anchors) == 2
            else ()
        ),
        sequence=draw(st.none() | st.just(tuple(pairs))),
        tag_offset=(draw(st.sampled_from([0.0, 0.125])), 0.0),
        range_offset=draw(st.none() | st.builds(RangeOffset, st.floats(-1, 1), positive)),
        decisions=tuple(
            Decision("pair", m, n, *draw(st.sampled_from([("keep",), ("guess", draw(guesses))])))
            for m, n in pairs
        ),
    )


# Files are made durable: how long that takes is the machine's business.
files = settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow])


@files
@given(surveys(), st.booleans(), st.sampled_from(["ccw", "cw"]))
def test_reads_back_the_same(tmp_path_factory, survey, compress, direction):
    folder = tmp_path_factory.mktemp("written") / "survey"
    options = {"compress": compress, "angle_direction": direction}
    write_survey(survey, folder, decimals=None, **options)
    check = check_survey(folder)
    assert check.faults == ()
    assert_same(check.survey, survey)


@files
@given(surveys())
def test_rounds_by_default(tmp_path_factory, survey):
    folder = tmp_path_factory.mktemp("written") / "survey"
    write_survey(survey, folder)
    # 3 decimals of metres, 4 of degrees (1.7e-6 rad), 15 of seconds; what is written is
    # read back as written, so that a second writing changes nothing.
    once = read_survey(folder)
    assert_same(once, survey, tolerance=5.1e-4)
    again = folder.with_name("again")
    write_survey(once, again)
    assert read_survey(again).checksum == once.checksum


@pytest.fixture
def survey():
    scan = Scan(np.deg2rad([10.0, 20.0]), np.array([1.23456, np.nan]), 40.0)
    return Survey(
        name="written",
        stations=(Station("s01", scan, 1.5),),
        anchors=(Anchor("A1", 2.4),),
        periods=(TwoWayPeriods("s01", "A1", [[1.0 / 3000.0] * 4]),),
    )


def test_files_and_decimals(survey, tmp_path):
    write_survey(survey, tmp_path / "out", compress=False, angle_direction="cw")
    scan = (tmp_path / "out" / "scans" / "s01.csv").read_text()
    assert scan == "angle_deg,range_m\n-10.0000,1.235\n-20.0000,\n"
    row = (tmp_path / "out" / "twr.csv").read_text().splitlines()[1]
    assert row == "s01,A1" + ",0.000333333333333" * 4
    assert (tmp_path / "out" / "survey.toml").read_text() == (
        'format = 1\nname = "written"\n\n[lidar]\nmodel = "scanse-sweep"\n'
        'angle_direction = "cw"\nmax_range_m = 40.0\n\n[tag]\nheight_m = 1.5\n\n'
        '[[stations]]\nid = "s01"\nscan = "scans/s01.csv"\n\n[[anchors]]\nid = "A1"\nheight_m = 2.4\n'
    )


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_zero_has_no_sign(survey, tmp_path, direction):
    """A clockwise scanner negates: neither that nor rounding may leave a -0."""
    scan = Scan(np.array([0.0, -1e-9, 1e-9]), np.ones(3), 40.0)
    near = replace(survey, stations=(Station("s01", scan, 1.5),))
    write_survey(near, tmp_path / "out", compress=False, angle_direction=direction)
    rows = (tmp_path / "out" / "scans" / "s01.csv").read_text().splitlines()[1:]
    assert rows == ["0.0000,1.000"] * 3


def test_same_bytes_every_time(survey, tmp_path):
    for name in ("one", "two"):
        write_survey(survey, tmp_path / name)
    names = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert [str(file) for file in names] == ["scans/s01.csv.gz", "survey.toml", "twr.csv.gz"]
    for file in names:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    # Byte 3 of a gzip header are its flags (0: no name), bytes 4 to 7 the time.
    packed = (tmp_path / "one" / "twr.csv.gz").read_bytes()
    assert packed[3:8] == bytes(5)
    assert gzip.decompress(packed).startswith(b"station,anchor,t1_s")


def test_reference_reads_back(survey, tmp_path):
    reference = Reference(
        stations={"s01": ReferencePlace(1.0, -2.0, 0.5), "s02": ReferencePlace(np.nan, np.nan)},
        anchors={"A1": ReferencePlace(3.25, 4.0)},
    )
    truth = {("s01", "A1"): (2, 0.31)}
    write_survey(survey, tmp_path / "out", reference=reference, link_truth=truth)
    for folder in (tmp_path / "out", tmp_path / "out" / "reference"):
        again = read_reference(folder)
        assert again.anchors == {"A1": ReferencePlace(3.25, 4.0, again.anchors["A1"].theta)}
        place = again.stations["s01"]
        assert (place.x, place.y) == (1.0, -2.0)
        assert place.theta == pytest.approx(0.5, abs=1e-8)
        assert np.isnan([again.stations["s02"].x, again.stations["s02"].theta]).all()
    links = (tmp_path / "out" / "reference" / "links.csv").read_text()
    assert links == "station,anchor,walls,error_m\ns01,A1,2,0.310000\n"


def test_foreign_folder_is_left_alone(survey, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SlamUwbError, match="exists and is no survey folder: nothing was changed"):
        write_survey(survey, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_survey_folder_is_replaced(survey, tmp_path):
    write_survey(survey, tmp_path / "out", compress=False)
    write_survey(survey, tmp_path / "out")
    assert not (tmp_path / "out" / "twr.csv").exists()
    assert check_survey(tmp_path / "out").faults == ()
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_what_one_survey_toml_cannot_say(survey, tmp_path):
    other = Station("s02", Scan(np.zeros(1), np.ones(1), 30.0), 1.5)
    with pytest.raises(ValueError, match=r"max_range \[30.0, 40.0\] m"):
        write_survey(replace(survey, stations=(*survey.stations, other)), tmp_path / "out")
    other = Station("s02", None, float("nan"))
    with pytest.raises(ValueError, match="tag_height is NaN at some stations only"):
        write_survey(replace(survey, stations=(*survey.stations, other)), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
