import math
from dataclasses import replace

import numpy as np
import pytest

from slam_uwb.model.geometry import Pose2
from slam_uwb.model.survey import Scan
from slam_uwb.scan import prepare_scan, reduce_scan
from slam_uwb.simulate.segments import distances_to_segments


def scan_of(samples, max_range=40.0):
    """Samples as (bearing in degrees, range in m)."""
    bearings, ranges = np.array(samples, dtype=float).reshape(-1, 2).T
    return Scan(np.radians(bearings), ranges, max_range)


def degrees(scan):
    return np.degrees(scan.bearings)


def points_of(scan):
    return scan.ranges[:, None] * np.column_stack([np.cos(scan.bearings), np.sin(scan.bearings)])


def assert_same_scan(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a.bearings, b.bearings, atol=tolerance)
    np.testing.assert_allclose(a.ranges, b.ranges, atol=tolerance)
    assert a.max_range == b.max_range


@pytest.fixture
def recording():
    """Ten noisy revolutions with dropouts, in recording order."""
    rng = np.random.default_rng(1)
    bearings = rng.uniform(0.0, 2.0 * math.pi, 3000)
    ranges = 3.0 + np.cos(bearings) + rng.normal(0.0, 0.02, 3000)
    return Scan(bearings, np.where(rng.uniform(size=3000) < 0.2, np.nan, ranges), 40.0)


def test_one_sample_a_bin_the_median_of_few(settings):
    # Bins [0, 1) and [1, 2) degrees; the median is not moved by one absurd sample as a mean is.
    reduced = reduce_scan(scan_of([(0.2, 2.0), (0.4, 2.02), (0.9, 9.0), (1.5, 4.0)]), settings)
    np.testing.assert_allclose(degrees(reduced), [0.4, 1.5])
    np.testing.assert_allclose(reduced.ranges, [2.02, 4.0])


def test_of_an_even_number_of_samples_the_middle_is_taken(settings):
    reduced = reduce_scan(scan_of([(0.1, 2.00), (0.3, 2.02), (0.5, 2.04), (0.9, 2.30)]), settings)
    middle = points_of(scan_of([(0.3, 2.02), (0.5, 2.04)])).mean(axis=0)
    np.testing.assert_allclose(points_of(reduced), [middle], atol=1e-12)


def test_half_of_many_samples_is_averaged(settings):
    # Of seven, two at either end by range do not count, wherever they are and whatever they say.
    samples = [(0.1, 0.5), (0.2, 2.00), (0.3, 1.9), (0.4, 2.04), (0.5, 2.02), (0.6, 2.09), (0.7, 9)]
    middle = points_of(scan_of([(0.2, 2.00), (0.4, 2.04), (0.5, 2.02)])).mean(axis=0)
    reduced = reduce_scan(scan_of(samples), settings)
    np.testing.assert_allclose(points_of(reduced), [middle], atol=1e-12)


@pytest.mark.parametrize("count", [360, 720, 1080, 1440, 2520])
def test_exact_samples_are_reduced_to_exact_points(settings, polygon, observe, count):
    """Whatever the angle between ray and wall: here down to one degree, 0.2 m between samples."""
    room, pose = polygon((0, 0), (12, 0), (12, 3), (4, 3), (4, 4.5), (0, 4.5)), Pose2(1, 0.2, 0.3)
    scan = observe(room, pose, count)
    reduced = reduce_scan(scan, settings)
    off = distances_to_segments(pose.transform(points_of(reduced)), room).min(axis=1)
    wall = distances_to_segments(pose.transform(points_of(scan)), room).argmin(axis=1)
    one_surface = np.ptp(wall.reshape(360, -1), axis=1) == 0
    assert one_surface.sum() >= 350
    assert off[one_surface].max() < 1e-9
    # A bin that holds a corner cuts it by what lies in the bin.
    assert off.max() < 0.01


def test_the_nearer_of_two_distant_samples_keeps_its_bearing(settings):
    # A wall that the rays graze: halfway between them in bearing, at the nearer range, nothing is.
    reduced = reduce_scan(scan_of([(0.25, 5.0), (0.75, 5.4)]), settings)
    np.testing.assert_allclose(reduced.ranges, [5.0])
    np.testing.assert_allclose(degrees(reduced), [0.25])


def test_many_noisy_samples_are_better_than_one(settings, polygon, observe):
    """80 samples a bin: the mean of half of them scatters by 1.3 sigma / sqrt(80), a lone one by sigma."""
    room, pose = polygon((0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5)), Pose2(2, 1.5, 0.3)
    exact = observe(room, pose, 28_800)
    noisy = replace(exact, ranges=exact.ranges + np.random.default_rng(5).normal(0, 0.01, 28_800))
    reduced = reduce_scan(noisy, settings)
    off = distances_to_segments(pose.transform(points_of(reduced)), room).min(axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.0015


def test_of_two_surfaces_in_one_bin_the_nearer_is_taken(settings):
    # The mean of the two middle samples, 3.02 m, would be a point where nothing is.
    near_and_far = [(0.1, 2.00), (0.2, 2.02), (0.3, 4.02), (0.4, 4.04)]
    assert reduce_scan(scan_of(near_and_far), settings).ranges == pytest.approx([2.02])


def test_the_larger_share_decides_between_two_surfaces(settings):
    mostly_far = [(0.1, 2.0), (0.2, 4.0), (0.3, 4.01), (0.4, 4.02)]
    assert reduce_scan(scan_of(mostly_far), settings).ranges == pytest.approx([4.005])


def test_the_seam_of_the_bearings_is_a_border_of_bins(settings):
    # 179.6 and 180.4 (that is -179.6) degrees lie 0.8 apart but on either side of the seam.
    reduced = reduce_scan(scan_of([(179.6, 2.0), (180.4, 3.0)]), settings)
    np.testing.assert_allclose(degrees(reduced), [-179.6, 179.6])
    np.testing.assert_allclose(reduced.ranges, [3.0, 2.0])


@pytest.mark.parametrize("bearing", [-180.0, 180.0, 540.0, -180.0 - 1e-13])
def test_the_seam_itself_is_minus_180(settings, bearing):
    reduced = reduce_scan(scan_of([(bearing, 2.0)]), settings)
    np.testing.assert_allclose(degrees(reduced), [-180.0])


def test_bearings_on_the_edge_of_a_bin_stay_together_however_the_scanner_is_turned(settings):
    # Sixteenths of a degree: every sixteenth bearing lies on an edge of the bins of one degree.
    bearings = np.arange(0.0, 360.0, 0.0625)
    ranges = 2.0 + 0.5 * np.random.default_rng(4).random(len(bearings))
    here = reduce_scan(scan_of(np.column_stack([bearings, ranges])), settings)
    for turn in (7.0, 14.0, 77.0, 185.0):
        there = reduce_scan(scan_of(np.column_stack([bearings - turn, ranges])), settings)
        np.testing.assert_allclose(np.roll(there.ranges, int(turn)), here.ranges, atol=1e-12)


def test_bearings_of_any_turn_are_one_direction(settings, recording):
    turned = replace(recording, bearings=recording.bearings - 4.0 * math.pi)
    assert_same_scan(reduce_scan(turned, settings), reduce_scan(recording, settings), 1e-9)


def test_the_order_of_the_samples_does_not_matter(settings, recording):
    order = np.random.default_rng(2).permutation(len(recording.ranges))
    shuffled = Scan(recording.bearings[order], recording.ranges[order], recording.max_range)
    assert_same_scan(reduce_scan(shuffled, settings), reduce_scan(recording, settings))


def test_a_scanner_that_turns_clockwise_gives_the_same(settings, recording):
    backwards = Scan(recording.bearings[::-1], recording.ranges[::-1], recording.max_range)
    assert_same_scan(reduce_scan(backwards, settings), reduce_scan(recording, settings))


@pytest.mark.parametrize("bin_deg", [0.7, 1.0, 2.5, 10.0])
def test_reducing_twice_changes_nothing(settings, recording, bin_deg):
    settings = settings.model_copy(update={"bin_deg": bin_deg})
    once = reduce_scan(recording, settings)
    assert len(once.bearings) == math.ceil(360.0 / bin_deg)
    assert_same_scan(reduce_scan(once, settings), once)


def test_reduced_bearings_ascend_in_the_half_open_turn(settings, recording):
    bearings = reduce_scan(recording, settings).bearings
    assert (np.diff(bearings) > 0.0).all()
    assert -math.pi < bearings[0] < bearings[-1] <= math.pi


@pytest.mark.parametrize("lost", [np.nan, 0.0, -1.0, 40.1, np.inf])
def test_what_is_no_return_does_not_count_as_one(settings, lost):
    reduced = reduce_scan(scan_of([(0.2, 2.0), (0.4, 2.0), (0.8, lost), (1.5, lost)]), settings)
    # To the sagitta between the two, 3 micrometres.
    np.testing.assert_allclose(reduced.ranges, [2.0, np.nan], atol=1e-5)
    # The place of a bin is that of its returns; where there are none, of all its samples.
    np.testing.assert_allclose(degrees(reduced), [0.3, 1.5])


@pytest.mark.parametrize(("returns", "seen"), [(1, False), (2, True), (3, True)])
def test_a_bin_with_few_returns_is_no_return(settings, returns, seen):
    samples = [(0.1 * k, 2.0 if k < returns else np.nan) for k in range(4)]
    reduced = reduce_scan(scan_of(samples), settings.model_copy(update={"min_return_share": 0.5}))
    assert np.isfinite(reduced.ranges).tolist() == [seen]


def test_bins_without_samples_are_absent(settings):
    reduced = reduce_scan(scan_of([(-90.5, 1.0), (45.5, 2.0)]), settings)
    np.testing.assert_allclose(degrees(reduced), [-90.5, 45.5])


def test_points_lie_on_the_walls_in_the_scanners_frame(settings, polygon, observe):
    room, pose = polygon((0, 0), (5, 0), (5, 4), (0, 4)), Pose2(2.0, 1.5, 0.8)
    prepared = prepare_scan("s1", observe(room, pose), settings)
    assert prepared.station == "s1"
    assert len(prepared.points) == 360
    assert distances_to_segments(pose.transform(prepared.points), room).min(axis=1).max() < 1e-12


def test_preparing_a_reduced_scan_is_preparing_the_recording(settings, recording):
    one = prepare_scan("s", recording, settings)
    two = prepare_scan("s", reduce_scan(recording, settings), settings)
    for name in ("points", "normals", "lengths", "segments", "landmarks", "free_ranges"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), atol=1e-9)


@pytest.mark.parametrize("theta", [0.0, 0.4, math.pi / 2, 3.0])
def test_normals_are_exact_on_straight_walls_and_face_the_scanner(
    settings, polygon, observe, theta
):
    room, pose = polygon((0, 0), (5, 0), (5, 4), (0, 4)), Pose2(2.0, 1.5, theta)
    prepared = prepare_scan("s", observe(room, pose), settings)
    world = pose.transform(prepared.points)
    distances = distances_to_segments(world, room)
    wall = distances.argmin(axis=1)
    # Inward normals of the four walls in order; of points whose neighbourhood holds no corner.
    inward = np.array([[0, 1], [-1, 0], [0, -1], [1, 0]]) @ pose.rotation
    far = np.sort(distances, axis=1)[:, 1] > 0.5
    assert far.sum() > 200
    np.testing.assert_allclose(prepared.normals[far], inward[wall[far]], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(prepared.normals, axis=1), 1.0)
    assert ((prepared.normals * prepared.points).sum(axis=1) < 0.0).all()


def test_corners_bend_no_normal(settings, polygon, observe):
    """Right up to the corner a point's neighbours are those of its own wall, and its normal exact."""
    room, pose = polygon((0, 0), (5, 0), (5, 4), (0, 4)), Pose2(2.0, 1.5, 0.3)
    prepared = prepare_scan("s", observe(room, pose), settings)
    normals = pose.rotation @ prepared.normals.T
    # Walls along the axes: each normal is a unit vector along one of them.
    assert (np.abs(normals).max(axis=0) > 1.0 - 1e-12).all()
    assert prepared.normal_variance.max() < 1e-9


def test_slope_variance_is_what_repeated_scans_show(settings, polygon, observe):
    """A wall 2 m ahead with 10 mm of noise: the slope's scatter over recordings is the variance told."""
    exact = observe([((-4, 2), (4, 2))], Pose2.identity())
    rng = np.random.default_rng(3)
    turns, told = [], []
    for _ in range(200):
        noisy = replace(exact, ranges=exact.ranges + rng.normal(0.0, 0.01, 360))
        prepared = prepare_scan("s", noisy, settings)
        ahead = np.argmin(np.abs(prepared.points[:, 0]))
        turns.append(math.atan2(prepared.normals[ahead, 0], -prepared.normals[ahead, 1]))
        told.append(prepared.normal_variance[ahead])
    assert 0.7 < np.var(turns) / np.mean(told) < 1.4


def test_lonely_points_have_no_normal(settings):
    prepared = prepare_scan("s", scan_of([(0.5, 2.0), (90.5, 2.0), (180.0, 2.0)]), settings)
    np.testing.assert_array_equal(prepared.normals, np.zeros((3, 2)))
    assert np.isinf(prepared.normal_variance).all()


def test_lengths_sum_to_the_perimeter_seen(settings, polygon, observe):
    # Nothing is capped in this room; at each corner the chord saves at most one gap (0.08 m) of wall.
    room = polygon((0, 0), (4, 0), (4, 4), (0, 4))
    prepared = prepare_scan("s", observe(room, Pose2(2.1, 1.8, 0.2)), settings)
    assert prepared.lengths.max() < settings.max_point_length_m
    assert 16.0 - 4 * 0.08 < prepared.lengths.sum() <= 16.0


def test_walls_count_by_length_wherever_the_scanner_stands(settings, polygon, observe):
    room = polygon((0, 0), (4, 0), (4, 4), (0, 4))
    for pose in (Pose2(2.0, 2.0, 0.0), Pose2(0.6, 2.0, 0.0)):
        prepared = prepare_scan("s", observe(room, pose), settings)
        left = pose.transform(prepared.points)[:, 0] < 1e-9
        assert prepared.lengths[left].sum() == pytest.approx(4.0, abs=0.1)


def test_a_point_stands_for_a_bounded_piece_of_wall(settings):
    prepared = prepare_scan("s", scan_of([(0.5, 9.0), (1.5, 9.0), (90.5, 5.0)]), settings)
    # The gaps are 0.157 m and two long ones, capped: (0.157 + 0.25) / 2 twice, and 0.25.
    gap = 2 * 9.0 * math.sin(math.radians(0.5))
    np.testing.assert_allclose(
        prepared.lengths, [(gap + 0.25) / 2, (gap + 0.25) / 2, 0.25], atol=1e-12
    )


def test_free_space_ends_at_the_nearest_return_of_three_sectors(settings):
    samples = [(k + 0.5, 5.0) for k in range(-180, 180)]
    samples[180 + 20] = (20.5, 2.0)
    free = prepare_scan("s", scan_of(samples), settings).free_ranges
    assert len(free) == 360
    np.testing.assert_allclose(free[180 + 19 : 180 + 22], 2.0)
    np.testing.assert_allclose(np.delete(free, range(180 + 19, 180 + 22)), 5.0)


def test_free_space_wraps_at_the_seam(settings):
    samples = [(k + 0.5, 5.0) for k in range(-180, 180)]
    samples[0] = (-179.5, 2.0)
    free = prepare_scan("s", scan_of(samples), settings).free_ranges
    np.testing.assert_allclose(free[[-1, 0, 1]], 2.0)
    np.testing.assert_allclose(free[2:-1], 5.0)


def test_where_nothing_came_back_nothing_is_known_to_be_free(settings):
    samples = [(k + 0.5, 5.0 if k < 0 else np.nan) for k in range(-180, 180)]
    free = prepare_scan("s", scan_of(samples), settings).free_ranges
    np.testing.assert_allclose(free[:180], 5.0)
    np.testing.assert_array_equal(free[180:], 0.0)


def test_noise_is_that_of_the_ranges(settings, polygon, observe):
    room = polygon((0, 0), (5, 0), (5, 4), (0, 4))
    exact = observe(room, Pose2(2.0, 1.5, 0.8))
    rng = np.random.default_rng(4)
    noisy = replace(exact, ranges=exact.ranges + rng.normal(0.0, 0.02, 360))
    assert prepare_scan("s", exact, settings).noise < 1e-12
    # Across a wall only its cosine with the ray shows, 0.6 to 1 in this room.
    assert 0.013 < prepare_scan("s", noisy, settings).noise < 0.022


def test_turning_the_scanner_turns_everything_it_saw(settings, polygon, observe):
    """By whole bins the same rays are cast, so that all comes out the same to the last digits."""
    room = polygon((0, 0), (6, 0), (6, 3), (4, 3), (4, 4.5), (0, 4.5))
    turn = Pose2(0.0, 0.0, math.radians(77.0))
    pose = Pose2(2.0, 1.5, 0.3)
    before = prepare_scan("s", observe(room, pose), settings)
    after = prepare_scan("s", observe(room, pose @ turn), settings)
    shift = np.argmin(np.linalg.norm(turn.transform(after.points) - before.points[0], axis=1))
    for name in ("points", "normals"):
        turned = np.roll(turn.transform(getattr(after, name)), -shift, axis=0)
        np.testing.assert_allclose(turned, getattr(before, name), atol=1e-9)
    np.testing.assert_allclose(np.roll(after.lengths, -shift), before.lengths, atol=1e-9)
    np.testing.assert_allclose(np.roll(after.free_ranges, -shift), before.free_ranges, atol=1e-9)
    for name in ("segments", "landmarks"):
        turned = turn.transform(getattr(after, name).reshape(-1, 2))
        expected = getattr(before, name).reshape(-1, 2)
        assert turned.shape == expected.shape
        nearest = np.linalg.norm(turned[:, None] - expected[None], axis=2).min(axis=0)
        assert nearest.max() < 1e-9


@pytest.mark.parametrize(
    "samples",
    [[], [(0.0, np.nan)], [(10.0 * k, np.nan) for k in range(36)], [(0.0, 0.0), (1.5, 99.0)]],
    ids=["no sample", "one lost", "all lost", "zero and too far"],
)
def test_scans_that_saw_nothing_are_empty(settings, samples):
    prepared = prepare_scan("s", scan_of(samples), settings)
    assert prepared.points.shape == prepared.normals.shape == (0, 2)
    assert prepared.lengths.shape == prepared.normal_variance.shape == (0,)
    assert prepared.segments.shape == (0, 2, 2)
    assert prepared.landmarks.shape == (0, 2)
    assert not prepared.free_ranges.any()
    assert np.isfinite(prepared.noise)


def test_one_point_is_a_scan_too(settings):
    prepared = prepare_scan("s", scan_of([(30.5, 2.0)]), settings)
    np.testing.assert_allclose(prepared.points, [[math.sqrt(3.0), 1.0]], atol=0.02)
    np.testing.assert_array_equal(prepared.lengths, [settings.max_point_length_m])
    assert prepared.segments.shape == (0, 2, 2)
    assert np.count_nonzero(prepared.free_ranges) == 1
