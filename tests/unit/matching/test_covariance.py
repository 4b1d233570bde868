import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.matching.covariance import match_covariance
from slam_uwb.matching.refiners.point_to_line import polish
from slam_uwb.model.geometry import Pose2

A, B = Pose2(2.0, 1.5, 0.5), Pose2(3.0, 2.2, -2.0)
TRUTH = A.inverse() @ B


@pytest.fixture(scope="module")
def bare(settings):
    """Without the floor for tilt, people and glass."""
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
        # Above the floor of 10 mm and 0.15 degrees, and millimetres beyond it.
        assert np.sqrt(np.diag(covariance))[:2].max() < 0.02
        assert math.sqrt(covariance[2, 2]) < math.radians(0.4)


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


def test_errors_of_refined_matches_are_what_the_covariance_tells(view, room, bare):
    """Normalised squared errors of 60 matches; in statistics/ there are more."""
    nees = []
    for seed in range(60):
        target, source = noisy_pair(view, room, A, B, seed)
        pose = Pose2.from_vector(polish(target, source, TRUTH.vector[None], bare)[0][0])
        covariance, _ = match_covariance(target, source, pose, bare)
        error = (TRUTH.inverse() @ pose).vector
        nees.append(error @ np.linalg.solve(covariance, error) / 3.0)
    # Ideal is 1; the formula is meant to be a little too wide (library facts: 0.7-0.9), never too tight.
    assert 0.3 < np.mean(nees) < 1.3
    assert np.quantile(nees, 0.95) < 3.5
