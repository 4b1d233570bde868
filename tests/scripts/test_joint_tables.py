"""The tables of the joint estimate: their parts by laws, each script once on a survey of two rooms."""

import csv
import math
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from slam_uwb import Pose2, Reference, Settings, simulate_survey
from slam_uwb.batch import map_tasks
from slam_uwb.model.survey import ReferencePlace
from slam_uwb.simulate import Lidar, Radio, Scene

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
MODULES = (
    "joint.faults", "joint.link_models", "joint.matched", "joint.scores",
    "table_ablation", "table_coverage", "table_robustness", "poses_and_ranges",
)  # fmt: skip
SHORT = 4.0
SEED = 1


@pytest.fixture(scope="module")
def load():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPTS))
        yield SimpleNamespace(**{n.removeprefix("joint."): import_module(n) for n in MODULES})


def two_rooms():
    """A wall of 12 cm with a door at its upper end, and a pier so that no turn maps the rooms on themselves."""
    faces = [
        ((0, 0), (9, 0)), ((9, 0), (9, 4.5)), ((9, 4.5), (0, 4.5)), ((0, 4.5), (0, 0)),
        ((4.94, 0), (4.94, 3.3)), ((5.06, 0), (5.06, 3.3)), ((4.94, 3.3), (5.06, 3.3)),
        ((2, 0), (2, 1)), ((2, 1), (2.8, 1)), ((2.8, 1), (2.8, 0)),
    ]  # fmt: skip
    return Scene(
        name="two-rooms",
        walls=np.array(faces, dtype=float),
        partitions=np.array([((5, 0), (5, 3.3))], dtype=float),
        stations=np.array([(1.2, 2.9), (3.6, 3.4), (4.1, 1.2), (5.9, 3.8), (7.6, 1.4)]),
        anchors=np.array([(0.1, 0.6, 2.2), (3.2, 4.4, 2.0), (8.9, 3.9, 2.3), (5.2, 0.2, 2.4)]),
        sequence=((0, 1), (1, 2), (1, 3), (3, 4)),
    )


@pytest.fixture(scope="module")
def made():
    return simulate_survey(two_rooms(), SEED, lidar=Lidar(duration=SHORT))


@pytest.fixture(scope="module")
def matched(load, made):
    return load.matched.match_survey(made.survey, made.reference, Settings())


def places(solution):
    return np.array([a.position for a in solution.anchors])


@pytest.mark.parametrize("loss", ["gaussian", "one_sided"])
def test_a_loss_has_the_slope_and_curvature_of_its_cost(load, loss):
    loss = getattr(load.link_models, loss)
    errors, h = np.array([-3.0, -0.4, 0.3, 1.0, 2.5, 40.0]), 1e-4
    below, at, above = (loss(errors + step) for step in (-h, 0.0, h))
    np.testing.assert_allclose(at[1], (above[0] - below[0]) / (2 * h), rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(at[2], (above[1] - below[1]) / (2 * h), rtol=1e-6, atol=1e-7)


def test_a_long_range_costs_less_one_sided_and_a_short_one_the_same(load):
    errors = np.array([-2.0, 0.0, 2.0, 20.0])
    plain, bent = load.link_models.gaussian(errors)[0], load.link_models.one_sided(errors)[0]
    np.testing.assert_allclose(bent[:2], plain[:2])
    assert (bent[2:] < plain[2:]).all()
    # Half of c^2 ln(1 + (e / c)^2) at e = 20, c = 2.385: 2.844 ln(71.32) = 12.14.
    assert bent[3] == pytest.approx(12.14, abs=0.01)


def test_a_loss_in_sigmas_scales_with_the_links_own(load):
    model = load.link_models.LossModel(load.link_models.gaussian, 0.1, 0.05)
    density = model.density(model.unlabelled(3), np.array([0.1, 0.2, np.inf]))
    errors = np.full(3, 0.3)
    # Three sigmas, one and a half, none: 9/2, 9/8, 0.
    np.testing.assert_allclose(density.costs(errors), [4.5, 1.125, 0.0])
    _, slopes, curvatures = density.expand(errors)
    np.testing.assert_allclose(slopes, [30.0, 7.5, 0.0])
    np.testing.assert_allclose(curvatures, [100.0, 25.0, 0.0])


def test_the_oracle_tells_a_link_by_its_ends_in_any_frame(load):
    stations = {"a": ReferencePlace(0.0, 0.0), "b": ReferencePlace(4.0, 0.0)}
    anchors = {"X": ReferencePlace(0.0, 3.0), "Y": ReferencePlace(4.0, 3.0)}
    walls = {("a", "X"): 0, ("a", "Y"): 1, ("b", "X"): 2, ("b", "Y"): 7}
    oracle = load.link_models.OracleModel(
        0.1, walls=walls, reference=Reference(stations, anchors), tag_offset=(0.1, 0.0)
    )
    assert np.isnan(oracle.labels(np.zeros((2, 2)), np.ones((2, 2)))).all()
    world_T_reference = Pose2(10.0, -2.0, 2.0)
    poses = {n: world_T_reference @ Pose2(p.x, p.y, 1.0) for n, p in stations.items()}
    tags = np.array([pose.transform((0.1, 0.0)) for pose in poses.values()])
    guesses = world_T_reference.transform(np.array([(0.2, 2.7), (4.3, 3.1)]))
    labels = oracle.at(poses).labels(tags, guesses[:, None, :])
    assert labels.shape == (2, 2, 5)
    # Anchors by stations; more than four walls are four.
    np.testing.assert_array_equal(labels.argmax(axis=2), [[0, 2], [1, 4]])
    np.testing.assert_array_equal(labels.sum(axis=2), 1.0)


def test_the_same_matches_solved_again_give_the_same_solution(matched):
    again = matched.solved(Settings().graph)
    assert len(matched.solution.matches) > 0
    assert len(places(again)) == 4
    np.testing.assert_allclose(places(again), places(matched.solution), atol=1e-5)
    assert again.frame == matched.solution.frame


def test_exact_ranges_give_exact_anchors_by_any_loss(load, matched, made):
    poses = {s.id: s.pose for s in matched.solution.stations}
    truth = {n: np.array([p.x, p.y]) for n, p in made.reference.anchors.items()}
    world_T_reference = poses["s01"] @ pose_of(made.reference.stations["s01"]).inverse()
    heights = {a.id: a.height for a in made.survey.anchors}
    links = []
    for link in matched.problem.links:
        place = world_T_reference.transform(truth[link.anchor])
        rise = heights[link.anchor] - made.survey.station(link.station).tag_height
        slant = math.hypot(*(place - poses[link.station].translation), rise)
        links.append(replace(link, distance=slant, mean=slant))
    case = load.table_ablation.Case(matched.with_links(links), {})
    for variant in (load.table_ablation.plain, load.table_ablation.long_allowed):
        for anchor in variant(case).anchors:
            place = world_T_reference.transform(truth[anchor.id])
            assert np.hypot(*(anchor.position - place)) < 1e-4


def pose_of(place):
    return Pose2(place.x, place.y, place.theta)


def test_every_part_of_the_method_has_its_row_and_its_gain(load):
    task = load.table_ablation.Task(two_rooms(), SEED, SHORT, Path())
    scores = load.table_ablation.solve_one(task)
    lines = load.table_ablation.table([scores]).splitlines()
    names = [line.split(" | ")[0].strip("| ") for line in lines[2:]]
    assert names == list(load.table_ablation.VARIANTS)
    assert lines[2].split(" | ")[3] == lines[-1].split(" | ")[4].strip() == "1.00"
    sequential, plain, _, offsets, *_, full, oracle = scores.values()
    assert all(math.isfinite(s.rmse) and s.anchors == 4 for s in scores.values())
    # At matches of a millimetre, one least squares is the other.
    assert plain.rmse == pytest.approx(sequential.rmse, rel=0.1)
    # Every range is long by 0.18 m: who knows of offsets is nearer.
    assert max(offsets.rmse, full.rmse, oracle.rmse) < sequential.rmse
    assert full.far == oracle.far == 0


def test_errors_drawn_anew_come_from_links_of_as_many_walls(load, matched, tmp_path):
    names = [(k.station, k.anchor) for k in matched.problem.links]
    walls = {name: k % 4 for k, name in enumerate(names)}
    published = {name: 0.1 * k for k, name in enumerate(names)}
    (tmp_path / "reference").mkdir()
    with (tmp_path / "reference" / "links.csv").open("w", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(("station", "anchor", "walls", "error_m"))
        rows.writerows((*name, walls[name], published[name]) for name in names)
    draw = load.table_ablation.recorded_case
    assert draw(matched, tmp_path, None).matched is matched
    links = {seed: draw(matched, tmp_path, seed).matched.problem.links for seed in (3, 4)}
    assert [k.distance for k in links[3]] != [k.distance for k in links[4]]
    assert draw(matched, tmp_path, 3).matched.problem.links == links[3]
    for new, old in zip(links[3], matched.problem.links, strict=True):
        name = (old.station, old.anchor)
        error = published[name] + new.distance - old.distance
        same = [published[n] for n in names if min(walls[n], 2) == min(walls[name], 2)]
        assert min(abs(error - other) for other in same) < 1e-9
        assert new.mean - old.mean == pytest.approx(new.distance - old.distance)
    assert draw(matched, tmp_path / "none", 3).walls == {}


def test_spoiled_links_jump_and_leave_three_of_every_anchor(load, matched):
    links = matched.problem.links
    spoiled, names = load.faults.spoil_links(links, 0.9, np.random.default_rng(0))
    jumps = [new.distance - old.distance for new, old in zip(spoiled, links, strict=True)]
    changed = {(k.station, k.anchor) for k, jump in zip(links, jumps, strict=True) if jump}
    # Five stations hear every anchor: two of them may go.
    assert changed == names
    assert len(names) == 2 * 4
    assert all(jump == 0.0 or 1.5 <= abs(jump) <= 30.0 for jump in jumps)
    assert all(k.distance >= 0.3 for k in spoiled)
    assert load.faults.spoil_links(links, 0.0, np.random.default_rng(0)) == (list(links), set())


def test_faults_are_counted_and_named(load):
    found = load.table_robustness.solve_faulty(load.table_robustness.Task(two_rooms(), SEED, SHORT))
    # A fifth of five links is one, of each of four anchors.
    assert found.faults == 4
    assert 0 < found.named <= 4
    # Of the anchors that it cannot place, the links are not called wrong.
    assert found.named_wrongly == 0
    # One of five links 2.4 m too short: a place 2.4 m off explains it by one more wall.
    assert found.spoiled.far == 0
    assert found.clean.rmse < found.spoiled.rmse
    row = load.table_robustness.fault_row("two-rooms", [found])
    assert len(row) == len(load.table_robustness.FAULT_COLUMNS)
    assert float(row[3]) == pytest.approx(found.spoiled.rmse / found.clean.rmse, abs=0.006)


def jump_one_link_an_anchor(links, sign, rng):
    """Near enough for walls, or another side of the stations, to explain it: 1.5 to 4 m."""
    jumped = list(links)
    for anchor in sorted({link.anchor for link in links}):
        size = rng.uniform(1.5, 4.0)
        rows = [k for k, link in enumerate(links) if link.anchor == anchor]
        row = rng.choice([k for k in rows if links[k].distance + sign * size > 0.3])
        link, jump = links[row], sign * size
        jumped[row] = replace(link, distance=link.distance + jump, mean=link.mean + jump)
    return jumped


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_one_wrong_link_of_five_makes_no_anchor_silently_wrong(load, seed):
    made = simulate_survey(two_rooms(), seed, lidar=Lidar(duration=SHORT))
    matched = load.matched.match_survey(made.survey, made.reference, Settings())
    scores = []
    for draw in range(2):
        for sign in (-1.0, 1.0):
            rng = np.random.default_rng([seed, draw])
            links = jump_one_link_an_anchor(matched.problem.links, sign, rng)
            solution = matched.with_links(links).solved(Settings().graph)
            scores.append(load.scores.score(solution, made.reference))

    assert [s.far for s in scores] == [0] * 4
    # Doubt where it is due, not everywhere.
    assert sum(s.ok for s in scores) >= 6


def test_links_in_sight_are_all_heard_and_as_good_by_least_squares(load):
    task = load.table_robustness.Task(two_rooms(), SEED, SHORT)
    found = load.table_robustness.solve_in_sight(task)
    rows = load.table_robustness.sight_rows("two-rooms", [found])
    assert rows[0][2] == rows[0][3] == "1.000"
    assert len(rows) == 3
    # Who is told that nothing is wrong with the radios hardly loses by a model for walls.
    assert found.calibrated.rmse < 1.3 * found.plain.rmse
    made = simulate_survey(two_rooms(), SEED, radio=load.table_robustness.IN_SIGHT)
    errors = np.array([error for _, error in made.link_truth.values()])
    assert abs(errors.mean()) < 3 * Radio().link_sigma / math.sqrt(len(errors))
    assert len(made.survey.ranges) == 5 * 4


def test_coverage_does_not_depend_on_the_number_of_workers(load, matched, made):
    script = load.table_coverage
    tasks = [script.Task(two_rooms(), seed, SHORT) for seed in (SEED, SEED + 1)]
    one, two = (map_tasks(script.solve_one, tasks, workers) for workers in (1, 2))
    assert one == two
    assert one[0] == script.own_coverage(matched.solution, made.reference)


def test_coverage_is_that_of_the_solutions_own_frame(load, matched, made):
    counts = load.table_coverage.own_coverage
    anchors, stations = counts(matched.solution, made.reference)
    assert (stations.items, stations.judged) == (4, 4)
    # Wherever the reference's frame lies.
    shift = Pose2(30.0, -4.0, 2.2)
    moved = Reference(
        {n: place_of(shift @ pose_of(p)) for n, p in made.reference.stations.items()},
        {
            n: ReferencePlace(*map(float, shift.transform((p.x, p.y))))
            for n, p in made.reference.anchors.items()
        },
    )
    assert counts(matched.solution, moved) == (anchors, stations)
    # Wherever the solution was moved to.
    axes = shift.rotation
    aligned = replace(
        matched.solution,
        stations=tuple(replace(s, pose=shift @ s.pose) for s in matched.solution.stations),
        anchors=tuple(
            replace(
                a, position=shift.transform(a.position), covariance=axes @ a.covariance @ axes.T
            )
            for a in matched.solution.anchors
        ),
        joint_covariance=None,
    )
    assert counts(aligned, made.reference) == (anchors, stations)
    # A truth ten sigmas off is outside and far, one at the estimate is inside.
    solution = matched.solution
    off = {a.id: 10.0 * math.sqrt(np.linalg.eigvalsh(a.covariance)[-1]) for a in solution.anchors}
    for scale, inside, far in ((0.0, 4, 0), (1.0, 0, 4)):
        here = Reference(
            {s.id: place_of(s.pose) for s in solution.stations},
            {
                a.id: ReferencePlace(a.position[0] + scale * off[a.id], a.position[1])
                for a in solution.anchors
            },
        )
        found, standing = counts(solution, here)
        assert (found.inside, found.judged, found.far) == (inside, 4, far)
        assert (standing.inside, standing.far) == (4, 0)
    row = load.table_coverage.row("two-rooms", [(anchors, stations)] * 2)
    assert len(row) == len(load.table_coverage.COLUMNS)
    assert row[5] == "100.0 % of 8"


def place_of(pose):
    return ReferencePlace(pose.x, pose.y, pose.theta)


def test_ranges_pull_poses_that_the_walls_leave_free(load):
    found = load.poses_and_ranges.weak_poses(0)
    alone, jointly = found["scans alone, the same matches"], found["jointly"]
    assert jointly.ok == jointly.stations == len(jointly.errors) == 2
    assert jointly.errors.max() < 0.5 * alone.errors.max()
    assert jointly.far == alone.far == 0
    lines = load.poses_and_ranges.rows("corridor", [found])
    assert all(len(line) == len(load.poses_and_ranges.COLUMNS) for line in lines)


def test_wrong_ranges_leave_sure_poses_alone(load):
    alone, jointly, spoiled = load.poses_and_ranges.sure_poses((two_rooms(), SEED)).values()
    assert spoiled.ok == jointly.ok == alone.ok == 4
    assert np.abs(spoiled.errors - alone.errors).max() < 0.002
