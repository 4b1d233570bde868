import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.covariance import _both_ways, _cost, match_covariance
from slam_uwb.matching.index import index_scan
from slam_uwb.matching.refiners.point_to_line import polish
from slam_uwb.model.geometry import Pose2
from slam_uwb.model.settings import MatchingSettings, ScanSettings
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan
from slam_uwb.simulate.segments import cast_rays

MATCHING = MatchingSettings()
A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B


@pytest.fixture(scope="module")
def bare(settings):
    """Without the floor for what no residual shows."""
    return settings.model_copy(update={"sigma_floor_m": 0.0, "sigma_floor_deg": 0.0})


def noisy_pair(view, walls, a, b, seed, noise=0.01, **casting):
    rng = np.random.default_rng(seed)
    return view("a", walls, a, rng, noise, **casting), view("b", walls, b, rng, noise, **casting)


def along(covariance, theta):
    """Standard deviation along the plan's x, for a source with heading `theta`."""
    axis = np.array([math.cos(theta), -math.sin(theta), 0.0])
    return math.sqrt(axis @ covariance @ axis)


def across(covariance, theta):
    axis = np.array([math.sin(theta), math.cos(theta), 0.0])
    return math.sqrt(axis @ covariance @ axis)


def test_symmetric_and_positive_definite(three_room_scans, three_room_poses, settings):
    names = list(three_room_scans)
    for m in names:
        for n in names:
            pose = three_room_poses[m].inverse() @ three_room_poses[n]
            covariance, _ = match_covariance(
                three_room_scans[m], three_room_scans[n], pose, settings
            )
            np.testing.assert_array_equal(covariance, covariance.T)
            assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_a_room_leaves_no_direction_free(view, room, settings):
    for seed in range(10):
        covariance, degenerate = match_covariance(
            *noisy_pair(view, room, A, B, seed), TRUTH, settings
        )
        assert not degenerate
        # Points of 10 mm, a hundred a wall: millimetres and hundredths of a degree.
        assert np.sqrt(np.diag(covariance))[:2].max() < 0.005
        assert math.sqrt(covariance[2, 2]) < math.radians(0.1)


def test_a_corridor_is_free_along_its_axis_only(view, corridor, settings):
    a, b = Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0)
    for seed in range(10):
        covariance, degenerate = match_covariance(
            *noisy_pair(view, corridor, a, b, seed, 0.005, max_range=12.0),
            a.inverse() @ b,
            settings,
        )
        assert degenerate
        assert along(covariance, b.theta) > 0.5
        assert across(covariance, b.theta) < 0.03
        assert math.sqrt(covariance[2, 2]) < math.radians(1.0)


def test_an_end_wall_holds_a_corridor(view, settings):
    walls = np.array([((-50, 0), (5, 0)), ((-50, 2), (5, 2)), ((5, 0), (5, 2))], dtype=float)
    a, b = Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0)
    for seed in range(10):
        covariance, degenerate = match_covariance(
            *noisy_pair(view, walls, a, b, seed, 0.005, max_range=12.0), a.inverse() @ b, settings
        )
        assert not degenerate
        assert along(covariance, b.theta) < 0.05


def test_the_axes_are_those_of_the_source(view, corridor, settings):
    """Whichever way the source's scanner points, the free direction turns with it and not with the target's."""
    a = Pose2(0.0, 0.8, 0.4)
    for theta in (0.0, math.pi / 2, 2.5):
        b = Pose2(2.0, 1.2, theta)
        covariance, _ = match_covariance(
            *noisy_pair(view, corridor, a, b, 3, 0.005, max_range=12.0), a.inverse() @ b, settings
        )
        values, axes = np.linalg.eigh(covariance[:2, :2])
        free = axes[:, np.argmax(values)]
        corridor_axis = np.array([math.cos(theta), -math.sin(theta)])
        assert abs(free @ corridor_axis) > 0.99


def test_a_swapped_match_has_the_covariance_in_the_other_axes(view, room, bare):
    """inverse(T Exp(xi)) = Exp(-xi) inverse(T) = inverse(T) Exp(-Ad_T xi)."""
    for seed in range(5):
        target, source = noisy_pair(view, room, A, B, seed)
        forth, _ = match_covariance(target, source, TRUTH, bare)
        back, _ = match_covariance(source, target, TRUTH.inverse(), bare)
        adjoint = TRUTH.adjoint()
        expected = adjoint @ forth @ adjoint.T
        np.testing.assert_allclose(back, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_twice_the_noise_is_twice_the_sigma(view, room, bare):
    ratios = []
    for seed in range(10):
        quiet, loud = (
            match_covariance(*noisy_pair(view, room, A, B, seed, noise), TRUTH, bare)[0]
            for noise in (0.005, 0.010)
        )
        ratios.append(np.sqrt(np.diag(loud) / np.diag(quiet)))
    np.testing.assert_allclose(np.median(ratios, axis=0), 2.0, rtol=0.25)


def test_the_floor_is_added_in_the_sources_axes(view, room, settings, bare):
    pair = noisy_pair(view, room, A, B, 1)
    floor = match_covariance(*pair, TRUTH, settings)[0] - match_covariance(*pair, TRUTH, bare)[0]
    sigmas = [
        settings.sigma_floor_m,
        settings.sigma_floor_m,
        math.radians(settings.sigma_floor_deg),
    ]
    np.testing.assert_allclose(floor, np.diag(np.square(sigmas)), atol=1e-12)


def test_exact_scans_have_the_floor_alone(view, room, settings):
    covariance, degenerate = match_covariance(
        view("a", room, A), view("b", room, B), TRUTH, settings
    )
    assert not degenerate
    np.testing.assert_allclose(np.sqrt(np.diag(covariance))[:2], settings.sigma_floor_m, rtol=1e-2)


def test_scans_that_do_not_fit_are_less_certain_than_their_noise(view, room, bare):
    """Residuals of 5 cm (moved furniture, tilt) count, where the scans themselves show 5 mm."""
    pair = noisy_pair(view, room, A, B, 1, 0.005)
    fitting, _ = match_covariance(*pair, TRUTH, bare)
    shifted, _ = match_covariance(*pair, TRUTH @ Pose2(0.05, 0.05, 0.0), bare)
    assert (np.diag(shifted) > 4.0 * np.diag(fitting)).all()


def test_scans_without_any_noise_have_a_covariance_too(view, room, settings):
    index = view("a", room, A)
    exact = replace(index, scan=replace(index.scan, noise=0.0))
    for pose, free in ((Pose2.identity(), False), (Pose2(300.0, 0.0, 0.0), True)):
        covariance, degenerate = match_covariance(exact, exact, pose, settings)
        assert degenerate == free
        assert np.linalg.eigvalsh(covariance).min() > 0.0


@pytest.mark.parametrize("pose", [Pose2(300.0, 0.0, 0.0), Pose2(0.0, 0.0, 0.0)])
def test_what_nothing_holds_is_free_and_finite(view, settings, pose):
    """Far apart, or walls with their backs to each other."""
    wall, other = [((2, -2), (2, 2))], [((-2, -2), (-2, 2))]
    covariance, degenerate = match_covariance(
        view("a", wall, Pose2.identity()), view("b", other, Pose2.identity()), pose, settings
    )
    assert degenerate
    assert np.isfinite(covariance).all()
    assert np.sqrt(np.diag(covariance)).min() > 0.1


def nees(target, source, truth, settings):
    """Normalised squared error of the match refined from the truth, a degree of freedom."""
    pose = Pose2.from_vector(polish(target, source, truth.vector[None], settings).poses[0])
    covariance, _ = match_covariance(target, source, pose, settings)
    error = (truth.inverse() @ pose).vector
    return error @ np.linalg.solve(covariance, error) / 3.0


def test_errors_of_refined_matches_are_what_the_covariance_tells(view, room, settings):
    """Normalised squared errors of 60 matches; in statistics/ there are more."""
    values = [nees(*noisy_pair(view, room, A, B, seed), TRUTH, settings) for seed in range(60)]
    assert 0.5 < np.mean(values) < 1.5
    assert np.quantile(values, 0.95) < 3.5


# Eight walls of an L-shaped room and four of a pillar in it.
PILLARED = np.array([
    ((0, 0), (9, 0)), ((9, 0), (9, 4)), ((9, 4), (5, 4)), ((5, 4), (5, 7)), ((5, 7), (0, 7)),
    ((0, 7), (0, 0)), ((2, 3), (2.8, 3)), ((2.8, 3), (2.8, 3.8)), ((2.8, 3.8), (2, 3.8)),
    ((2, 3.8), (2, 3)),
], dtype=float)  # fmt: skip


def shifted(walls, rng, sigma):
    """Every wall moved along its normal by an error of its own: what a scanner makes of paint and glass."""
    along = walls[:, 1] - walls[:, 0]
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return walls + (rng.normal(0.0, sigma, len(walls))[:, None] * normals)[:, None]


def test_walls_that_miss_each_other_by_centimetres_are_seen_as_such(view, settings):
    """The points of a wall err together: counted one by one they would claim millimetres where 1 cm is true."""
    a, b = Pose2(1.5, 1.5, 0.5), Pose2(4.0, 2.2, -2.0)
    truth, values, sigmas = a.inverse() @ b, [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        target, source = (
            view(name, shifted(PILLARED, rng, 0.01), pose, rng, 0.003)
            for name, pose in (("a", a), ("b", b))
        )
        values.append(nees(target, source, truth, settings))
        sigmas.append(math.sqrt(match_covariance(target, source, truth, settings)[0][0, 0]))
    assert 0.4 < np.mean(values) < 2.0
    # Three or four walls hold each direction, each with an error of 14 mm between the scans.
    assert 0.004 < np.median(sigmas) < 0.015


def test_the_hessian_of_a_square_room_is_that_of_its_walls(view, bare):
    """A room of side a: both ways 2 a metres of wall hold x and y, and about its middle the turn 4 a^3 / 12.

    Seen from (u, v) the turn has 2 a (u^2 + v^2) more, and x and y are bound to it by -2 a v, 2 a u.
    """
    side, u, v = 4.0, 0.6, -0.3
    corners = np.array([(-2, -2), (2, -2), (2, 2), (-2, 2)], dtype=float)
    walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    pose = Pose2(u, v, 0.0)
    scan = view("a", walls, pose)
    (rows,) = _both_ways(scan, scan, np.zeros((1, 3)), bare.fine_gate_m)
    cost = _cost(rows, 0.0)
    lever = 2.0 * side * (u**2 + v**2)
    expected = 2.0 * np.array([
        [2 * side, 0.0, 2 * side * v],
        [0.0, 2 * side, -2 * side * u],
        [2 * side * v, -2 * side * u, 4 * side**3 / 12 + lever],
    ])  # fmt: skip
    # Points a degree apart cut the corners by some centimetres.
    np.testing.assert_allclose(cost.hessian, expected, atol=0.035 * expected.max())
    assert cost.sharpness == pytest.approx(1.0)


def turned_pair(walls, a, b, turn_a, turn_b, max_range):
    """Indices of the same recordings by scanners turned by whole degrees."""
    rng = np.random.default_rng(4)
    bearings = np.radians(np.arange(-180, 180) + 0.5)
    for name, pose, turn in (("a", a, turn_a), ("b", b, turn_b)):
        ranges = cast_rays(pose.translation, bearings + pose.theta, walls)
        ranges = ranges + rng.normal(0.0, 0.01, len(ranges))
        scan = Scan(
            bearings - math.radians(turn),
            np.where(ranges <= max_range, ranges, np.nan),
            max_range,
        )
        yield index_scan(prepare_scan(name, scan, ScanSettings()), MATCHING)


@pytest.mark.parametrize("scene", ["room", "corridor"])
def test_turning_the_scanners_turns_the_covariance_with_the_sources_axes(request, scene, settings):
    """T R_b Exp(xi) = T Exp(Ad_R xi) R_b; which way the target was turned is of no account."""
    walls = request.getfixturevalue(scene)
    a, b = (A, B) if scene == "room" else (Pose2(0.0, 0.8, 0.4), Pose2(2.0, 1.2, -1.0))
    covariances = []
    for turn_a, turn_b in ((0, 0), (40, 0), (0, 113), (-77, 160)):
        turns = (Pose2(0.0, 0.0, math.radians(turn)) for turn in (turn_a, turn_b))
        target, source = turned_pair(walls, a, b, turn_a, turn_b, 12.0)
        first, second = turns
        pose = (a @ first).inverse() @ b @ second
        covariance, degenerate = match_covariance(target, source, pose, settings)
        assert degenerate == (scene == "corridor")
        adjoint = second.adjoint()
        covariances.append(adjoint @ covariance @ adjoint.T)
    for covariance in covariances[1:]:
        scale = np.sqrt(np.outer(np.diag(covariances[0]), np.diag(covariances[0])))
        assert np.abs((covariance - covariances[0]) / scale).max() < 0.02


def test_a_free_axis_leaves_the_walls_beside_it_as_certain_as_without(view, corridor, settings):
    """What is free along a corridor does not make the heading or the distance to its walls uncertain."""
    a, b = Pose2(0.0, 0.8, 0.0), Pose2(2.0, 1.2, 0.0)
    covariance, degenerate = match_covariance(
        *noisy_pair(view, corridor, a, b, 2, max_range=12.0), a.inverse() @ b, settings
    )
    assert degenerate
    sigmas = np.sqrt(np.diag(covariance))
    assert sigmas[0] > 0.9
    assert sigmas[1] < 0.01
    assert sigmas[2] < math.radians(0.2)
