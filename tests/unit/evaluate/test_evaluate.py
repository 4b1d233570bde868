"""Evaluation of whole solutions: known answers, what is left out and counted, NEES."""

import json
import math

import numpy as np
import pytest

from slam_uwb.evaluate import ErrorSummary, evaluate_solution, evaluation_to_json, format_evaluation
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import Settings
from slam_uwb.model.solution import AnchorEstimate, Solution, StationEstimate, Status
from slam_uwb.model.survey import Reference, ReferencePlace

TRUE_STATIONS = {
    "s1": Pose2(1.0, 1.0, 0.1),
    "s2": Pose2(-1.0, 1.0, 1.0),
    "s3": Pose2(-1.0, -1.0, -3.0),
    "s4": Pose2(1.0, -1.0, 2.5),
}
TRUE_ANCHORS = {"A": (4.0, 0.0), "s1": (0.0, 5.0), "C": (-3.0, -3.0)}  # one shares a station's name
WORLD_T_REFERENCE = Pose2(7.0, -2.0, 2.3)


def reference(stations=TRUE_STATIONS, anchors=TRUE_ANCHORS):
    return Reference(
        stations={
            name: ReferencePlace(pose.x, pose.y, pose.theta) for name, pose in stations.items()
        },
        anchors={name: ReferencePlace(*place) for name, place in anchors.items()},
    )


def station(name, pose, status=Status.OK, covariance=None, **more):
    """Pose given in the reference's frame."""
    world = None if pose is None else WORLD_T_REFERENCE @ pose
    return StationEstimate(name, world, covariance, status, **more)


def anchor(name, place, status=Status.OK, covariance=None):
    """Place given in the reference's frame, covariance in the world's axes."""
    world = None if place is None else WORLD_T_REFERENCE.transform(place)
    return AnchorEstimate(name, world, covariance, 2.0, 3, status)


def solution(stations=None, anchors=None, frame="s1", joint=None, joint_names=()):
    return Solution(
        survey_name="square", checksum="", mode="joint", settings=Settings(), software_version="0",
        frame=frame,
        stations=tuple(stations if stations is not None else [station(*item) for item in TRUE_STATIONS.items()]),
        anchors=tuple(anchors if anchors is not None else [anchor(*item) for item in TRUE_ANCHORS.items()]),
        matches=(), links=(), biases=(), joint_names=tuple(joint_names), joint_covariance=joint, checks=None,
        floor_map=None, scans={},
    )  # fmt: skip


def by_name(group):
    return {item.id: item for item in group.items}


def test_without_errors_there_are_none():
    evaluation = evaluate_solution(solution(), reference())
    assert evaluation.alignment == "stations"
    for group, count in ((evaluation.stations, 4), (evaluation.anchors, 3)):
        assert (group.expected, group.unplaced, group.without_reference, group.not_ok) == (
            count,
            0,
            0,
            (),
        )
        assert group.ok_errors.count == count
        assert group.ok_errors.max < 1e-12
    assert evaluation.stations.ok_heading_errors.max < 1e-12
    back = evaluation.reference_T_world @ WORLD_T_REFERENCE
    assert back.distance_to(Pose2.identity()) < 1e-12
    assert back.angle_to(Pose2.identity()) < 1e-12


def test_anchor_errors_by_hand():
    # The stations are exact, so the frame is; anchors are off by (0.3, 0.4), nothing, and (0, -1).
    places = [("A", (4.3, 0.4)), ("s1", (0.0, 5.0)), ("C", (-3.0, -4.0))]
    group = evaluate_solution(
        solution(anchors=[anchor(*item) for item in places]), reference()
    ).anchors
    item = by_name(group)["A"]
    assert (item.dx, item.dy, item.error) == pytest.approx((0.3, 0.4, 0.5))
    assert math.isnan(item.heading_error)
    summary = group.ok_errors
    # sqrt((0.25 + 0 + 1) / 3), the middle one, the largest
    assert (summary.rmse, summary.median, summary.max) == pytest.approx(
        (math.sqrt(1.25 / 3), 0.5, 1.0)
    )


def test_station_errors_by_hand():
    # Every station 10 % further from the centre: no rigid motion helps, each is off by sqrt(2) / 10. All headings
    # are 0.02 rad too large, s2's by 0.02 across the cut at pi.
    truth = TRUE_STATIONS | {"s2": Pose2(-1.0, 1.0, math.pi - 0.01)}
    stations = [
        station(name, Pose2(1.1 * pose.x, 1.1 * pose.y, pose.theta + 0.02))
        for name, pose in truth.items()
    ]
    group = evaluate_solution(solution(stations), reference(truth)).stations
    assert group.ok_errors.rmse == pytest.approx(math.sqrt(2.0) / 10)
    assert group.ok_errors.median == pytest.approx(math.sqrt(2.0) / 10)
    assert [item.heading_error for item in group.items] == pytest.approx([0.02] * 4)


def test_only_ok_stations_align_and_all_placed_are_scored():
    # s4 is 5 m off and says so: it must not turn the frame, nor count among the ok.
    stations = [station(*item) for item in TRUE_STATIONS.items() if item[0] != "s4"]
    stations.append(station("s4", Pose2(4.0, 3.0, 2.5), Status.WEAK_GEOMETRY))
    anchors = [anchor("A", (4.0, 0.2)), anchor("s1", (1.0, 5.0), Status.MIRROR_AMBIGUOUS)]
    anchors.append(anchor("C", None, Status.UNREACHABLE))
    evaluation = evaluate_solution(solution(stations, anchors), reference())
    assert by_name(evaluation.stations)["s3"].error < 1e-12
    assert evaluation.stations.ok_errors.max < 1e-12
    assert evaluation.stations.placed_errors.max == pytest.approx(5.0)
    assert evaluation.stations.not_ok == (("s4", Status.WEAK_GEOMETRY),)
    group = evaluation.anchors
    assert (group.ok_errors.count, group.ok_errors.rmse) == (1, pytest.approx(0.2))
    # sqrt((0.04 + 1) / 2)
    assert (group.placed_errors.count, group.placed_errors.rmse) == (
        2,
        pytest.approx(math.sqrt(0.52)),
    )
    assert (group.expected, group.unplaced) == (3, 1)
    assert group.not_ok == (("s1", Status.MIRROR_AMBIGUOUS), ("C", Status.UNREACHABLE))


def test_incomplete_references_are_skipped_and_counted():
    truth = reference()
    truth.stations["s2"] = ReferencePlace(math.nan, math.nan, 1.0)  # heading only
    truth.stations["s3"] = ReferencePlace(-1.0, -1.0)  # no heading
    truth.stations["s4"] = ReferencePlace(1.0, math.nan, math.nan)
    truth.stations["elsewhere"] = ReferencePlace(0.0, 0.0, 0.0)
    truth.stations["nowhere"] = ReferencePlace(math.nan, math.nan)
    del truth.anchors["C"]
    evaluation = evaluate_solution(solution(), truth)
    stations = evaluation.stations
    # Known: s1 and s3, and one that the solution lacks.
    assert (stations.expected, stations.unplaced, stations.without_reference) == (3, 1, 2)
    assert stations.absent == ("elsewhere",)
    assert stations.ok_errors.count == 2
    items = by_name(stations)
    assert items["s2"].heading_error == pytest.approx(0.0, abs=1e-12)
    assert math.isnan(items["s2"].error)
    assert math.isnan(items["s3"].heading_error)
    assert items["s3"].error < 1e-12
    assert math.isnan(items["s4"].error)
    anchors = evaluation.anchors
    assert (anchors.expected, anchors.unplaced, anchors.without_reference) == (2, 0, 1)


def test_an_unknown_heading_is_not_scored():
    stations = [
        station(name, pose, heading_known=name != "s2") for name, pose in TRUE_STATIONS.items()
    ]
    items = by_name(evaluate_solution(solution(stations), reference()).stations)
    assert math.isnan(items["s2"].heading_error)
    assert items["s2"].error < 1e-12
    assert items["s1"].heading_error == pytest.approx(0.0, abs=1e-12)


def test_a_site_frame_is_not_aligned():
    # Everything half a metre beside the truth in a frame that claims to be the site's: that is an error.
    beside = Pose2(0.5, 0.0, 0.0)
    stations = [
        StationEstimate(name, beside @ pose, None, Status.OK)
        for name, pose in TRUE_STATIONS.items()
    ]
    anchors = [AnchorEstimate("A", np.array([4.5, 0.0]), None, 2.0, 3, Status.OK)]
    evaluation = evaluate_solution(solution(stations, anchors, "site"), reference())
    assert evaluation.alignment == "site"
    assert evaluation.reference_T_world == Pose2.identity()
    assert [item.dx for item in evaluation.stations.items] == pytest.approx([0.5] * 4)
    assert evaluation.anchors.ok_errors.rmse == pytest.approx(0.5)


def test_without_reference_stations_the_anchors_align():
    truth = reference(stations={})
    assert evaluate_solution(solution(), truth).alignment == "anchors"
    # An anchor that is not ok has no say: C is 3 m off and the others are exact.
    anchors = [
        anchor("A", (4.0, 0.0)),
        anchor("s1", (0.0, 5.0)),
        anchor("C", (-3.0, 0.0), Status.WEAK_GEOMETRY),
    ]
    evaluation = evaluate_solution(solution(anchors=anchors), truth)
    assert evaluation.anchors.ok_errors.max < 1e-12
    assert evaluation.anchors.placed_errors.max == pytest.approx(3.0)
    assert evaluation.stations.expected == 0


def test_what_is_aligned_on_can_be_chosen():
    # The stations stand as they should; each anchor is off by the same (0.3, 0.4) in the reference's axes.
    # On the stations every anchor errs by 0.5; on the anchors none does, and the stations err by 0.5. On
    # both, by least squares, the shift lies between, so that neither errs by 0 or by 0.5.
    moved = [anchor(n, (x + 0.3, y + 0.4)) for n, (x, y) in TRUE_ANCHORS.items()]
    found = {
        kind: evaluate_solution(solution(anchors=moved), reference(), kind)
        for kind in ("auto", "stations", "anchors", "both")
    }
    assert [item.alignment for item in found.values()] == [
        "stations",
        "stations",
        "anchors",
        "both",
    ]
    for kind in ("auto", "stations"):
        assert found[kind].anchors.ok_errors.rmse == pytest.approx(0.5)
        assert found[kind].stations.ok_errors.rmse == pytest.approx(0.0, abs=1e-9)
    assert found["anchors"].anchors.ok_errors.rmse == pytest.approx(0.0, abs=1e-9)
    assert found["anchors"].stations.ok_errors.rmse == pytest.approx(0.5)
    assert 0.05 < found["both"].anchors.ok_errors.rmse < 0.45
    assert 0.05 < found["both"].stations.ok_errors.rmse < 0.45


def test_unaligned_takes_the_places_as_they_are():
    # The solution's frame is WORLD_T_REFERENCE away: unaligned, the first anchor errs by how far that moves it.
    found = evaluate_solution(solution(), reference(), "unaligned")
    assert found.alignment == "unaligned"
    moved = WORLD_T_REFERENCE.transform(TRUE_ANCHORS["A"]) - TRUE_ANCHORS["A"]
    assert by_name(found.anchors)["A"].error == pytest.approx(np.linalg.norm(moved))
    # And a site frame can be aligned on the stations where that is asked for.
    site = evaluate_solution(solution(frame="site"), reference(), "stations")
    assert site.anchors.ok_errors.rmse == pytest.approx(0.0, abs=1e-9)


def test_one_reference_station_fixes_no_frame():
    # Its error is measured all the same, in the frame of the anchors.
    evaluation = evaluate_solution(solution(), reference(stations={"s3": TRUE_STATIONS["s3"]}))
    assert evaluation.alignment == "anchors"
    assert (evaluation.stations.expected, evaluation.stations.ok_errors.count) == (1, 1)
    assert evaluation.stations.ok_errors.max < 1e-12


def test_summaries_ignore_signs_and_unknowns():
    # |-3|, 1, 2: sqrt(14 / 3), 2, 3
    summary = ErrorSummary.of([-3.0, 1.0, math.nan, 2.0])
    assert summary == ErrorSummary(3, math.sqrt(14.0 / 3.0), 2.0, 3.0)


def test_what_cannot_be_aligned_is_not_scored():
    # The reference knows the stations, but only one of them is ok: anchors do not step in.
    stations = [
        station(name, pose, Status.OK if name == "s1" else Status.DISCONNECTED)
        for name, pose in TRUE_STATIONS.items()
    ]
    evaluation = evaluate_solution(solution(stations), reference())
    assert (evaluation.alignment, evaluation.reference_T_world) == ("none", None)
    assert evaluation.anchors.ok_errors.count == 0
    assert math.isnan(evaluation.anchors.ok_errors.rmse)
    assert (evaluation.stations.expected, evaluation.stations.unplaced) == (4, 0)
    assert "NOT POSSIBLE" in format_evaluation(evaluation)
    assert evaluation_to_json(evaluation)["reference_T_world"] is None


@pytest.mark.parametrize("frame", ["s1", "site"])
def test_moving_the_solution_changes_nothing_but_the_frame(frame):
    # In a site frame the motion is an error, else it is none: covered both ways by the errors themselves.
    random = np.random.default_rng(1)
    stations = [station(n, p @ Pose2(*random.normal(0, 0.05, 3)), covariance=np.eye(3) * 1e-3)
                for n, p in TRUE_STATIONS.items()]  # fmt: skip
    anchors = [
        anchor(n, random.normal(p, 0.1), covariance=np.diag([1e-2, 2e-2]))
        for n, p in TRUE_ANCHORS.items()
    ]
    motion = Pose2(3.0, 1.0, -1.2)
    turned = motion.rotation
    moved = [StationEstimate(s.id, motion @ s.pose, s.covariance, s.status) for s in stations]
    moved_anchors = [
        AnchorEstimate(
            a.id, motion.transform(a.position), turned @ a.covariance @ turned.T, 2.0, 3, a.status
        )
        for a in anchors
    ]
    before = evaluate_solution(solution(stations, anchors, frame), reference())
    after = evaluate_solution(solution(moved, moved_anchors, frame), reference())
    values = [
        [(i.dx, i.dy, i.nees) for g in (e.stations, e.anchors) for i in g.items]
        for e in (before, after)
    ]
    if frame == "site":
        assert not np.allclose(*values)
    else:
        np.testing.assert_allclose(*values, atol=1e-9)


def test_nees_by_hand_in_a_site_frame():
    # No alignment: an anchor off by (0.3, 0.4) with sigmas 0.1 and 0.2 has NEES 9 + 4.
    # A station that looks along +y, 0.2 m too far along its x axis (sigma 0.1) and 0.03 rad (sigma 0.01): 4 + 9.
    truth = Pose2(2.0, 1.0, math.pi / 2)
    stations = [
        StationEstimate(
            "s", Pose2(2.0, 1.2, math.pi / 2 + 0.03), np.diag([0.01, 1.0, 1e-4]), Status.OK
        )
    ]
    anchors = [AnchorEstimate("A", np.array([4.3, 0.4]), np.diag([0.01, 0.04]), 2.0, 3, Status.OK)]
    evaluation = evaluate_solution(
        solution(stations, anchors, "site"), reference({"s": truth}, {"A": (4.0, 0.0)})
    )
    assert evaluation.anchors.ok_nees == (pytest.approx(13.0), 2)
    # The estimate's axes are turned by 0.03 rad, which brings in the sideways sigma: 0.1 % of 4.
    assert evaluation.stations.ok_nees == (pytest.approx(13.0, abs=0.02), 3)


def test_nees_is_left_out_where_the_covariance_cannot_tell():
    # One station fixed by the frame (zero), one without covariance; an anchor with a full one.
    stations = [
        StationEstimate("s1", TRUE_STATIONS["s1"], np.zeros((3, 3)), Status.OK),
        StationEstimate("s2", TRUE_STATIONS["s2"], None, Status.OK),
    ]
    anchors = [AnchorEstimate("A", np.array([4.0, 0.1]), np.eye(2) * 0.01, 2.0, 3, Status.OK)]
    evaluation = evaluate_solution(solution(stations, anchors, "site"), reference())
    assert [item.nees_dof for item in evaluation.stations.items] == [0, 0]
    assert evaluation.anchors.ok_nees == (pytest.approx(1.0), 2)


def random_covariance(random, rows, scale):
    root = random.normal(size=(rows, rows))
    return scale**2 * (root @ root.T / rows + 0.3 * np.eye(rows))


@pytest.mark.parametrize("known", ["stations", "anchors", "some stations"])
def test_nees_of_drawn_errors_equals_its_degrees_of_freedom(known):
    # Errors drawn from the joint covariance itself, s1 exact as in its own frame: after whatever alignment the
    # mean NEES of each item must be its degrees of freedom. 600 draws of a chi-square with d degrees of freedom
    # have a mean with standard deviation sqrt(2 d / 600): 0.1 for d = 3; four of them are allowed.
    random = np.random.default_rng(5)
    names = [*TRUE_STATIONS, *TRUE_ANCHORS]
    rows = 3 * len(TRUE_STATIONS) + 2 * len(TRUE_ANCHORS)
    joint = random_covariance(random, rows, 1e-3)
    joint[:3] = joint[:, :3] = 0.0
    root = np.linalg.svd(joint)
    root = root.U * np.sqrt(root.S)
    truth = reference(stations={} if known == "anchors" else TRUE_STATIONS)
    weak = {"s4"} if known == "some stations" else set()
    totals = {}
    for _ in range(600):
        drawn = root @ random.normal(size=rows)
        stations = [
            station(n, p @ Pose2(*drawn[3 * k : 3 * k + 3]), Status.WEAK_GEOMETRY if n in weak else Status.OK,
                    joint[3 * k : 3 * k + 3, 3 * k : 3 * k + 3])
            for k, (n, p) in enumerate(TRUE_STATIONS.items())
        ]  # fmt: skip
        anchors = []
        for k, (name, place) in enumerate(TRUE_ANCHORS.items()):
            at = slice(12 + 2 * k, 14 + 2 * k)
            position = WORLD_T_REFERENCE.transform(place) + drawn[at]
            anchors.append(AnchorEstimate(name, position, joint[at, at], 2.0, 3, Status.OK))
        evaluation = evaluate_solution(
            solution(stations, anchors, joint=joint, joint_names=names), truth
        )
        for kind in ("stations", "anchors"):
            for item in getattr(evaluation, kind).items:
                totals.setdefault((kind, item.id, item.nees_dof), []).append(item.nees)
    for (kind, name, dof), values in totals.items():
        if known == "anchors" and kind == "stations":
            assert dof == 0
            continue
        assert dof == (3 if kind == "stations" else 2), (kind, name)
        assert np.mean(values) == pytest.approx(dof, abs=4 * math.sqrt(2 * dof / 600)), (kind, name)


def test_json_is_plain_and_complete():
    anchors = [
        anchor("A", (4.3, 0.4)),
        anchor("s1", None, Status.UNREACHABLE),
        anchor("C", (-3.0, -3.0)),
    ]
    text = json.dumps(
        evaluation_to_json(evaluate_solution(solution(anchors=anchors), reference())),
        allow_nan=False,
    )
    values = json.loads(text)
    assert values["survey"] == "square"
    assert values["alignment"] == "stations"
    assert values["reference_T_world"]["yaw_deg"] == pytest.approx(-math.degrees(2.3))
    assert values["anchors"]["expected"] == 3
    assert values["anchors"]["unplaced"] == 1
    assert values["anchors"]["not_ok"] == [{"id": "s1", "status": "unreachable"}]
    assert values["anchors"]["ok"]["rmse_m"] == pytest.approx(0.5 / math.sqrt(2))
    assert values["anchors"]["ok_nees"] == {"sum": None, "dof": 0}
    first, second, _ = values["anchors"]["items"]
    assert first["error_m"] == pytest.approx(0.5)
    assert second["error_m"] is None
    assert values["stations"]["ok_heading"]["count"] == 4


def test_text_has_a_line_for_everything():
    anchors = [
        anchor("A", (4.3, 0.4)),
        anchor("s1", None, Status.UNREACHABLE),
        anchor("C", (-3.0, -3.0)),
    ]
    truth = reference()
    truth.anchors["D"] = ReferencePlace(0.0, 0.0)
    del truth.stations["s2"]
    text = format_evaluation(evaluate_solution(solution(anchors=anchors), truth))
    lines = text.splitlines()
    assert not any(line != line.rstrip() or "nan" in line for line in lines)
    row = next(line.split() for line in lines if line.startswith("A "))
    assert row == ["A", "ok", "0.500", "+0.300", "+0.400", "-"]
    assert any(line.split()[:2] == ["s1", "unreachable,"] for line in lines)
    assert next(line for line in lines if line.startswith("anchors   ok")).split()[2:5] == [
        "2",
        "of",
        "4",
    ]
    assert "anchors without a place: 2" in lines
    assert "stations that the reference does not know: 1" in lines
    assert [line.split()[0] for line in lines if line.startswith("s")][-3:] == ["s1", "s3", "s4"]
    assert "anchors of the reference that the solution lacks: D" in lines
